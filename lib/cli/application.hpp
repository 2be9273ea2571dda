// Arguments and errors of a program with commands.
#pragma once

#include <CLI/CLI.hpp>

#include "cli/common_options.hpp"

namespace dpr::cli {

/// Parses the arguments, which runs the command they choose. What goes wrong becomes one line on stderr and
/// the exit status: 1 for wrong input or an output that cannot be written, 2 if the device failed.
int run_application(CLI::App& application, CommonOptions& common, int argc, char** argv);

}  // namespace dpr::cli
