// Folder of the files that tests compare with.
#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

namespace dpr::test {

/// tests/data of the source tree.
std::filesystem::path data_folder();

/// The files of a folder whose name ends like this, in alphabetical order; none is an error.
std::vector<std::filesystem::path> files_in(const std::filesystem::path& folder, std::string_view ending);

}  // namespace dpr::test
