// Hidden files that don't outlive their use: not by an error, a signal, or a process that was killed.
#pragma once

#include <filesystem>

namespace dpr {

/// An empty file of its own in a folder, open for writing, which the destructor removes. It is locked while
/// it lives, so that other processes can tell it from one that a killed process left. The first one in a
/// folder removes such stale ones.
class TemporaryFile {
 public:
  /// Throws std::system_error.
  explicit TemporaryFile(const std::filesystem::path& folder);
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  int descriptor() const noexcept { return descriptor_; }

  /// Becomes a file of that name in the same folder, in place of what has it. Throws std::system_error.
  void rename_to(const std::filesystem::path& file);

 private:
  std::filesystem::path path_;
  int descriptor_ = -1, slot_ = -1;
};

/// Removes the temporary files of this process. Safe in a signal handler; the process should end then. The
/// library handles no signals: a program that wants this calls it in its own handlers.
void remove_temporary_files() noexcept;

}  // namespace dpr
