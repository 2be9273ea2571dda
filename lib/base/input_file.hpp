// Files that are read.
#pragma once

#include <filesystem>
#include <string>

namespace dpr {

/// Throws IoError where there is no such file, or a folder in its place.
void require_file(const std::filesystem::path& file);

/// The bytes of a file, read once from front to back. Throws IoError, also where a pipe or a device does not
/// end.
std::string read_file(const std::filesystem::path& file);

/// ".png" for "a.PNG".
std::string lower_case_extension(const std::filesystem::path& file);

}  // namespace dpr
