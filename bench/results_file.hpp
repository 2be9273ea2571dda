// Files of results: what is in them, and which rows of two files belong together.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/json.hpp"

namespace dpr::bench {

using cli::Json;

/// Schema of a results file, as bench/README.md describes it. A file may lack later versions' additions.
inline constexpr int k_results_schema = 1;

/// Reads a file that `dpr bench -o` wrote. Throws IoError where it cannot be read or is not JSON,
/// InvalidArgument where it is of another schema or a row lacks what this program needs.
Json read_results(const std::filesystem::path& file);

/// Names a row: workload, preset, composition, estimator and samples, with what a sweep varies.
std::string row_name(const Json& row);

/// True if the row has figures.
bool is_measured(const Json& row);

/// Forward and backward milliseconds of a measured row together: the sum of their medians, or q1 or q3.
double total_ms(const Json& row, const char* figure = "median");

}  // namespace dpr::bench
