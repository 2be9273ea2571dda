// Store of facts about devices that outlives the program: the binaries of programs, and how
// drivers fared with the kernels.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "dpr/device.hpp"

namespace dpr {

/// The hash as 16 hexadecimal digits.
std::string hash_text(std::string_view bytes);

/// Values by keys, a file each, in a folder that processes share: files are written whole, compared with
/// their key and a checksum when they are read, and the oldest go where all together take more than the
/// bound. Nothing here fails: what cannot be read is not there, what cannot be written is not remembered. May
/// be used from several threads.
class Store {
 public:
  static constexpr std::size_t k_most_bytes = std::size_t{256} << 20;

  /// In the folder that the environment names: DPR_CACHE_DIR, or else dpr in XDG_CACHE_HOME or in .cache of
  /// HOME. "off", or none of these: nothing is remembered.
  Store();
  explicit Store(std::filesystem::path folder, std::size_t most_bytes = k_most_bytes)
      : folder_(std::move(folder)), most_bytes_(most_bytes) {}

  bool is_on() const { return !folder_.empty(); }
  std::optional<std::string> load(const std::string& key) const;
  void save(const std::string& key, std::string_view value) const;

 private:
  std::filesystem::path file_of(const std::string& key) const;
  void remove_oldest() const;

  std::filesystem::path folder_;  // empty: off
  std::size_t most_bytes_ = k_most_bytes;
};

/// A key's part that names a device, its driver, and this version of the library.
std::string device_key(const DeviceInfo& info);

}  // namespace dpr
