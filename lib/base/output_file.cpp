// Temporary files are made in the folder of their target, so that the rename at the end stays on one file
// system.
#include "base/output_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <optional>
#include <sstream>
#include <string>
#include <system_error>

#include "base/input_file.hpp"
#include "dpr/error.hpp"

namespace dpr {
namespace {

using Status = struct stat;

[[noreturn]] void cannot_write(const std::filesystem::path& file, int error) {
  throw IoError(file, "cannot be written: " + std::generic_category().message(error));
}

/// The end of a chain of links, which need not be there.
std::filesystem::path follow_links(const std::filesystem::path& file) {
  constexpr int k_most_links = 40;  // Linux' own bound
  std::filesystem::path path = file;
  for (int i = 0; i < k_most_links; ++i) {
    std::error_code error;
    if (!is_symlink(symlink_status(path, error))) return path;
    path = path.parent_path() / read_symlink(path, error);
    if (error) cannot_write(file, error.value());
  }
  cannot_write(file, ELOOP);
}

std::filesystem::path folder_of(const std::filesystem::path& file) {
  return file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
}

/// Status of the file, if it exists. Throws IoError if it cannot be written.
std::optional<Status> find(const std::filesystem::path& file) {
  Status status{};
  if (stat(file.c_str(), &status) != 0) {
    const int reason = errno;
    std::error_code ignored;
    const std::filesystem::path folder = folder_of(follow_links(file));
    if (!is_directory(folder, ignored)) {
      throw IoError(file, "the folder " + folder.string() + " does not exist");
    }
    if (reason == ENOENT) return {};
    cannot_write(file, reason);
  }
  if (S_ISDIR(status.st_mode)) throw IoError(file, "is a folder");
  if (S_ISBLK(status.st_mode) || S_ISSOCK(status.st_mode)) {
    throw IoError(file, "cannot be written: neither a file, nor a FIFO or a character device");
  }
  if (const auto input = guarded_input(file))
    throw IoError(file, "cannot be written: it is the file that is read as " + input->string());
  if (faccessat(AT_FDCWD, file.c_str(), W_OK, AT_EACCESS) != 0) cannot_write(file, errno);
  return status;
}

bool is_stream(const std::optional<Status>& status) { return status && !S_ISREG(status->st_mode); }

}  // namespace

OutputFile::OutputFile(const std::filesystem::path& file) : file_(file) {
  if (is_stream(find(file))) {
    descriptor_ = open(file.c_str(), O_WRONLY | O_CLOEXEC | O_NOCTTY);
    if (descriptor_ < 0) fail(errno);
    return;
  }
  destination_ = follow_links(file);
  try {
    temporary_ = std::make_unique<TemporaryFile>(folder_of(destination_));
  } catch (const std::system_error& error) {
    fail(error.code().value());
  }
  descriptor_ = temporary_->descriptor();
}

OutputFile::~OutputFile() {
  if (!temporary_ && descriptor_ >= 0) close(descriptor_);
}

void OutputFile::fail(int error) const { cannot_write(file_, error); }

void OutputFile::write(const void* bytes, std::size_t count) noexcept {
  const char* at = static_cast<const char*>(bytes);
  while (count > 0 && error_ == 0) {
    const ssize_t written = ::write(descriptor_, at, count);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) {
      error_ = written < 0 ? errno : EIO;
      return;
    }
    at += written;
    count -= static_cast<std::size_t>(written);
    size_ += static_cast<std::size_t>(written);
  }
}

/// The temporary file, which takes over what the file in its place has beside its content.
void OutputFile::store_on_disk() {
  if (const std::optional<Status> before = find(destination_)) {
    // Who may not give files away keeps them.
    [[maybe_unused]] const int ignored = fchown(descriptor_, before->st_uid, before->st_gid);
    if (fchmod(descriptor_, before->st_mode & 0777U) != 0) fail(errno);
  }
  if (fsync(descriptor_) != 0) fail(errno);  // some file systems tell only now that there is no room
  Status status{};
  if (fstat(descriptor_, &status) != 0) fail(errno);
  if (static_cast<std::size_t>(status.st_size) != size_) fail(EIO);
}

void OutputFile::commit() {
  if (error_ != 0) fail(error_);
  if (!temporary_) {
    const int result = close(descriptor_);
    descriptor_ = -1;
    if (result != 0) fail(errno);
    return;
  }
  store_on_disk();
  try {
    temporary_->rename_to(destination_);
  } catch (const std::system_error& error) {
    fail(error.code().value());
  }
}

void require_writable(const std::filesystem::path& file) {
  if (!is_stream(find(file))) const OutputFile beside(file);
}

void write_whole_file(const std::filesystem::path& file, std::string_view bytes) {
  OutputFile output(file);
  output.write(bytes.data(), bytes.size());
  output.commit();
}

void write_whole_file(const std::filesystem::path& file, const std::function<void(std::ostream&)>& write) {
  std::ostringstream text;
  write(text);
  if (!text) throw IoError(file, "cannot be written: its content could not be made");
  write_whole_file(file, text.str());
}

void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error || !std::filesystem::is_directory(folder)) {
    throw IoError(folder, "the folder cannot be made: " + (error ? error.message() : "a file has its name"));
  }
}

}  // namespace dpr
