// dpr bench.
#pragma once

#include <CLI/CLI.hpp>

#include "cli/common_options.hpp"

namespace dpr::cli {

/// Makes the application the benchmark: its options, and what it does with them.
void add_bench_options(CLI::App& application, CommonOptions& common);

}  // namespace dpr::cli
