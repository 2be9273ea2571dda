// Files that appear whole or not at all.
#pragma once

#include <filesystem>
#include <functional>
#include <iosfwd>

namespace dpr {

/// A name beside `target`, with the same extension, for a file that becomes `target` by commit() and is
/// removed otherwise. Owns the file, not a handle to it: close what is written before commit().
class TemporaryFile {
 public:
  /// Throws IoError where the folder of `target` does not exist.
  explicit TemporaryFile(std::filesystem::path target);
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  const std::filesystem::path& path() const noexcept { return path_; }

  /// Renames the file to the target, which is replaced. Throws IoError.
  void commit();

 private:
  std::filesystem::path target_, path_;
  bool committed_ = false;
};

/// Throws IoError where a file cannot be written; leaves what is there. For work that would be lost without.
void require_writable(const std::filesystem::path& file);

/// Writes what `write` puts into the stream (binary) to a temporary file, which then becomes `file`. Throws
/// IoError; what `write` throws passes through, and leaves nothing behind.
void write_whole_file(const std::filesystem::path& file, const std::function<void(std::ostream&)>& write);

}  // namespace dpr
