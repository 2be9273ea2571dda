// Files of results: what is in them, and which rows of two files belong together.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/json.hpp"

namespace dpr::bench {

using cli::Json;

/// Of a results file: {"schema", "commit", "device", "build_options", "repetitions", "max_seconds",
/// "results": [...]}.
inline constexpr int k_results_schema = 1;

/// Reads a file that `dpr bench -o` wrote. Throws IoError where it cannot be read or is not JSON,
/// InvalidArgument where it is of another schema or a row lacks what this program needs.
Json read_results(const std::filesystem::path& file);

/// Names a row: workload, preset, composition, estimator and samples, with what a sweep varies.
std::string row_name(const Json& row);

/// Whether the row has figures.
bool is_measured(const Json& row);

/// Median forward and backward milliseconds of a measured row together.
double total_ms(const Json& row);

}  // namespace dpr::bench
