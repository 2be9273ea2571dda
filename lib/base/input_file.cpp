#include "base/input_file.hpp"

#include <algorithm>
#include <cctype>
#include <fstream>

#include "dpr/error.hpp"

namespace dpr {
namespace {

/// Most bytes read from a pipe or a device. A longer one, such as /dev/zero, is taken to have no end.
constexpr std::size_t k_most_streamed = std::size_t{1} << 28U;

constexpr std::size_t k_chunk = std::size_t{1} << 16U;

}  // namespace

void require_file(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) throw IoError(file, "the file does not exist");
  if (std::filesystem::is_directory(file, error)) throw IoError(file, "is a folder, expected a file");
}

std::string read_file(const std::filesystem::path& file) {
  require_file(file);
  std::ifstream in(file, std::ios::binary);
  if (!in.is_open()) throw IoError(file, "the file cannot be read");
  std::error_code error;
  const bool is_regular = std::filesystem::is_regular_file(file, error);
  std::string bytes;
  // A first guess: the size of a regular file, which may grow meanwhile, or be 0 as those of /proc are.
  const std::uintmax_t size = is_regular ? std::filesystem::file_size(file, error) : 0;
  if (!error) bytes.reserve(static_cast<std::size_t>(size) + k_chunk);
  while (in) {
    const std::size_t before = bytes.size();
    if (!is_regular && before > k_most_streamed) {
      throw IoError(file, "is no regular file and does not end: expected at most " +
                              std::to_string(k_most_streamed >> 20U) + " MiB from a pipe or a device");
    }
    bytes.resize(before + k_chunk);
    in.read(bytes.data() + before, k_chunk);
    bytes.resize(before + static_cast<std::size_t>(in.gcount()));
  }
  if (in.bad()) throw IoError(file, "the file cannot be read");
  return bytes;
}

std::string lower_case_extension(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

}  // namespace dpr
