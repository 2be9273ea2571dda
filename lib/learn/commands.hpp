// The commands of dpr learn.
#pragma once

#include <CLI/CLI.hpp>

#include "cli/common_options.hpp"

namespace dpr::cli {

/// data, train, eval and show.
void add_learn_commands(CLI::App& application, CommonOptions& common);

}  // namespace dpr::cli
