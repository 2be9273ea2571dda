// Results as comma-separated values.
#pragma once

#include <string>

#include "results_file.hpp"

namespace dpr::bench {

/// A line of names, then one a row, by RFC 4180: what the row is, its figures, and its status. A timing is
/// six columns, "forward_ms_median" and so on; a failed row leaves its figures empty. Stages and single runs
/// are in the JSON file alone.
std::string to_csv(const Json& results);

}  // namespace dpr::bench
