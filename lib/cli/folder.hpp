// Folders that commands write to.
#pragma once

#include <filesystem>

namespace dpr::cli {

/// Makes the folder where it is missing, those above it too. Throws IoError.
void make_folder(const std::filesystem::path& folder);

}  // namespace dpr::cli
