#include "base/input_file.hpp"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <sstream>
#include <utility>

#include "dpr/error.hpp"

namespace dpr {

void require_file(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) throw IoError(file, "the file does not exist");
  if (std::filesystem::is_directory(file, error)) throw IoError(file, "is a folder, expected a file");
}

std::string read_file(const std::filesystem::path& file) {
  require_file(file);
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  if (in.peek() != std::ifstream::traits_type::eof()) text << in.rdbuf();
  if (!in.is_open() || in.bad() || text.fail()) throw IoError(file, "the file cannot be read");
  return std::move(text).str();
}

std::string lower_case_extension(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

}  // namespace dpr
