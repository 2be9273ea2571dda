// Files that appear whole or not at all.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <iosfwd>
#include <memory>
#include <string_view>

#include "base/temporary_file.hpp"

namespace dpr {

/// A file on its way to its name. What is written goes to a temporary file beside it, which commit() stores
/// on the disk and renames; without commit(), what was there stays. Links are followed: the file at their end
/// is replaced. A file that is replaced leaves its mode to the new one, and its owner where the process may
/// give it. A character device or a FIFO is written to directly. Guarded inputs (guard_inputs()) are not replaced.
class OutputFile {
 public:
  /// Throws IoError where the file cannot be written. Waits for the reader of a FIFO.
  explicit OutputFile(const std::filesystem::path& file);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// Appends. What goes wrong is told by commit(), so that writers which must not throw can call it.
  void write(const void* bytes, std::size_t count) noexcept;

  /// Throws IoError where anything went wrong since the constructor, and leaves what was there.
  void commit();

 private:
  [[noreturn]] void fail(int error) const;
  void store_on_disk();

  std::filesystem::path file_, destination_;  // as it was called, and with its links followed
  std::unique_ptr<TemporaryFile> temporary_;  // none for devices and FIFOs
  int descriptor_ = -1;
  std::size_t size_ = 0;
  int error_ = 0;
};

/// Throws IoError where a file cannot be written; leaves what is there. For work that would be lost without.
void require_writable(const std::filesystem::path& file);

/// Makes the file hold these bytes. Throws IoError, and leaves what was there.
void write_whole_file(const std::filesystem::path& file, std::string_view bytes);

/// The same with what `write` puts into the stream (binary); what it throws passes through.
void write_whole_file(const std::filesystem::path& file, const std::function<void(std::ostream&)>& write);

/// Makes the folder where it is missing, those above it too. Throws IoError.
void make_folder(const std::filesystem::path& folder);

}  // namespace dpr
