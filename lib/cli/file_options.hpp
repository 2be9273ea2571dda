// Options that name files.
#pragma once

#include <CLI/CLI.hpp>

namespace dpr::cli {

/// Makes a command refuse, before it starts, to write a file that another of its options names too, to read or to write:
/// one of them would be lost. Pipes and devices may be shared. Files that a file names are not looked at.
void refuse_shared_files(CLI::App& command);

}  // namespace dpr::cli
