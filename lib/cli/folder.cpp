#include "cli/folder.hpp"

#include <system_error>

#include "dpr/error.hpp"

namespace dpr::cli {

void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error || !std::filesystem::is_directory(folder)) {
    throw IoError(folder, "the folder cannot be made: " + (error ? error.message() : "a file has its name"));
  }
}

}  // namespace dpr::cli
