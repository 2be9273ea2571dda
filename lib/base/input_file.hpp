// Files that are read.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace dpr {

/// Throws IoError where there is no such file, or a folder in its place. Else counts the file as read.
void require_file(const std::filesystem::path& file);

/// The bytes of a file, read once from front to back. Throws IoError, also where a pipe or a device does not
/// end.
std::string read_file(const std::filesystem::path& file);

/// From now on OutputFile refuses the files that this process has read, for commands: programs that use the library may
/// read a file and write it anew.
void guard_inputs();

/// Counts a file as read, which the readers do.
void add_input(const std::filesystem::path& file);

/// Lets a file that was read be replaced: a checkpoint.
void release_input(const std::filesystem::path& file);

/// The file that was read and is the same one, by whatever name, if inputs are guarded.
std::optional<std::filesystem::path> guarded_input(const std::filesystem::path& file);

/// One that was read from this folder, not from those in it.
std::optional<std::filesystem::path> guarded_input_in(const std::filesystem::path& folder);

/// ".png" for "a.PNG".
std::string lower_case_extension(const std::filesystem::path& file);

}  // namespace dpr
