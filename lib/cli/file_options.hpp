// Options that name files.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

namespace dpr::cli {

/// Makes a command refuse, before it starts, to write a file that another of its options names too, to read or to
/// write: one of them would be lost. Pipes and devices may be shared. Files that a file names are left to
/// require_outputs().
void refuse_shared_files(CLI::App& command);

/// Throws unless these files can be written, each is another one and none was read, and the folder of the report, if
/// there is one, holds no file that was read. For the time between reading and work.
void require_outputs(const std::vector<std::filesystem::path>& files, const std::string& report = "");

}  // namespace dpr::cli
