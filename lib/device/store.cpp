#include "device/store.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <span>
#include <vector>

#include "base/hash.hpp"
#include "base/output_file.hpp"
#include "dpr/error.hpp"
#include "dpr/version.hpp"

namespace dpr {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view k_ending = ".dpr";

fs::path folder_of_environment() {
  const auto variable = [](const char* name) {
    const char* const value = std::getenv(name);
    return std::string(value == nullptr ? "" : value);
  };
  if (const std::string own = variable("DPR_CACHE_DIR"); !own.empty()) return own == "off" ? "" : own;
  if (const std::string caches = variable("XDG_CACHE_HOME"); !caches.empty()) return fs::path(caches) / "dpr";
  const std::string home = variable("HOME");
  return home.empty() ? fs::path() : fs::path(home) / ".cache" / "dpr";
}

/// A file's first bytes; key and value follow.
struct Head {
  std::array<char, 8> magic{'d', 'p', 'r', 's', 't', 'o', 'r', '1'};
  std::uint64_t key_bytes = 0, value_bytes = 0, checksum = 0;  // of key and value
};

std::uint64_t hash_of(std::string_view bytes) {
  Hash hash;
  hash.add_bytes(std::as_bytes(std::span(bytes)));
  return hash.value();
}

}  // namespace

std::string hash_text(std::string_view bytes) {
  std::array<char, 17> digits{};
  std::snprintf(digits.data(), digits.size(), "%016llx", static_cast<unsigned long long>(hash_of(bytes)));
  return digits.data();
}

Store::Store() : folder_(folder_of_environment()) {}

fs::path Store::file_of(const std::string& key) const {
  return folder_ / (hash_text(key) + std::string(k_ending));
}

std::optional<std::string> Store::load(const std::string& key) const {
  if (!is_on()) return std::nullopt;
  const fs::path path = file_of(key);
  std::ifstream file(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  Head head;
  if (bytes.size() < sizeof head) return std::nullopt;
  std::memcpy(&head, bytes.data(), sizeof head);
  const std::string_view content = std::string_view(bytes).substr(sizeof head);
  if (head.magic != Head{}.magic || head.key_bytes != key.size() || !content.starts_with(key) ||
      head.value_bytes != content.size() - key.size() || head.checksum != hash_of(content))
    return std::nullopt;
  std::error_code ignored;
  fs::last_write_time(path, fs::file_time_type::clock::now(), ignored);  // not among the oldest
  return std::string(content.substr(key.size()));
}

void Store::save(const std::string& key, std::string_view value) const {
  if (!is_on() || value.size() > most_bytes_) return;
  std::error_code ignored;
  fs::create_directories(folder_, ignored);
  const std::string content = key + std::string(value);
  Head head;
  head.key_bytes = key.size();
  head.value_bytes = value.size();
  head.checksum = hash_of(content);
  std::string bytes(sizeof head, '\0');
  std::memcpy(bytes.data(), &head, sizeof head);
  try {
    write_whole_file(file_of(key), bytes + content);
  } catch (const IoError&) {
    return;  // a folder that is not there or full, or may not be written to
  }
  remove_oldest();
}

void Store::remove_oldest() const {
  struct Entry {
    fs::path path;
    std::size_t bytes;
    fs::file_time_type time;
  };
  std::vector<Entry> entries;
  std::size_t bytes = 0;
  std::error_code error;  // another process may remove files at the same time
  for (fs::directory_iterator it(folder_, error), end; !error && it != end; it.increment(error)) {
    if (it->path().extension() != k_ending) continue;
    std::error_code gone;
    const Entry entry{it->path(), fs::file_size(it->path(), gone), fs::last_write_time(it->path(), gone)};
    if (gone) continue;
    bytes += entry.bytes;
    entries.push_back(entry);
  }
  std::ranges::sort(entries, {}, &Entry::time);
  for (const Entry& entry : entries) {
    if (bytes <= most_bytes_) return;
    std::error_code ignored;
    fs::remove(entry.path, ignored);
    bytes -= entry.bytes;
  }
}

std::string device_key(const DeviceInfo& info) {
  return std::string("dpr ") + DPR_VERSION + "\n" + info.platform + "\n" + info.name + "\n" + info.vendor +
         "\n" + info.version + "\n" + info.driver + "\nlanes " + std::to_string(info.lanes) + "\n";
}

}  // namespace dpr
