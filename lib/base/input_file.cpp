#include "base/input_file.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <fstream>
#include <map>
#include <mutex>
#include <utility>

#include "dpr/error.hpp"

namespace dpr {
namespace {

/// Most bytes read from a pipe or a device. A longer one, such as /dev/zero, is taken to have no end.
constexpr std::size_t k_most_streamed = std::size_t{1} << 28U;

constexpr std::size_t k_chunk = std::size_t{1} << 16U;

using FileKey = std::pair<dev_t, ino_t>;

/// Regular files alone: pipes and devices lose nothing.
std::optional<FileKey> key_of(const std::filesystem::path& file) {
  struct stat status {};
  if (stat(file.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return std::nullopt;
  return FileKey(status.st_dev, status.st_ino);
}

std::atomic<bool> g_are_guarded = false;
std::mutex g_mutex;
std::map<FileKey, std::filesystem::path> g_inputs;

}  // namespace

void guard_inputs() { g_are_guarded = true; }

void add_input(const std::filesystem::path& file) {
  const std::optional<FileKey> key = g_are_guarded ? key_of(file) : std::nullopt;
  if (!key) return;
  const std::lock_guard lock(g_mutex);
  g_inputs[*key] = file;
}

void release_input(const std::filesystem::path& file) {
  const std::lock_guard lock(g_mutex);
  if (const std::optional<FileKey> key = key_of(file)) g_inputs.erase(*key);
}

std::optional<std::filesystem::path> guarded_input(const std::filesystem::path& file) {
  const std::lock_guard lock(g_mutex);
  const std::optional<FileKey> key = key_of(file);
  const auto found = key ? g_inputs.find(*key) : g_inputs.end();
  // The number of a file that is gone may be another's by now.
  if (found == g_inputs.end() || key_of(found->second) != key) return std::nullopt;
  return found->second;
}

std::optional<std::filesystem::path> guarded_input_in(const std::filesystem::path& folder) {
  const std::lock_guard lock(g_mutex);
  std::error_code error;
  for (const auto& [key, file] : g_inputs) {
    if (std::filesystem::equivalent(std::filesystem::absolute(file).parent_path(), folder, error))
      return file;
  }
  return std::nullopt;
}

void require_file(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) throw IoError(file, "the file does not exist");
  if (std::filesystem::is_directory(file, error)) throw IoError(file, "is a folder, expected a file");
  add_input(file);
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
