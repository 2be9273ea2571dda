// Temporary files in the folder of their target, so that the rename at the end stays on one file system.
#include "base/temporary_file.hpp"

#include <fstream>
#include <random>
#include <string>
#include <system_error>

#include "dpr/error.hpp"

namespace dpr {
namespace {

// Two processes or threads that write the same target must not share the temporary file.
std::string unlikely_suffix() {
  std::random_device random;
  return std::to_string(random()) + std::to_string(random());
}

}  // namespace

TemporaryFile::TemporaryFile(std::filesystem::path target) : target_(std::move(target)) {
  std::filesystem::path folder = target_.parent_path();
  if (folder.empty()) folder = ".";
  std::error_code error;
  if (!std::filesystem::is_directory(folder, error)) {
    throw IoError(target_, "the folder " + folder.string() + " does not exist");
  }
  if (std::filesystem::is_directory(target_, error)) throw IoError(target_, "is a folder");
  path_ = folder / ("." + target_.stem().string() + "." + unlikely_suffix() + target_.extension().string());
}

TemporaryFile::~TemporaryFile() {
  std::error_code ignored;
  if (!committed_) std::filesystem::remove(path_, ignored);
}

void TemporaryFile::commit() {
  std::error_code error;
  std::filesystem::rename(path_, target_, error);
  if (error) throw IoError(target_, "cannot be written: " + error.message());
  committed_ = true;
}

void require_writable(const std::filesystem::path& file) {
  const TemporaryFile beside(file);
  if (!std::ofstream(beside.path())) throw IoError(file, "cannot be written");
}

void write_whole_file(const std::filesystem::path& file, const std::function<void(std::ostream&)>& write) {
  TemporaryFile temporary(file);
  std::ofstream out(temporary.path(), std::ios::binary);
  write(out);
  out.close();
  if (!out) throw IoError(file, "cannot be written");
  temporary.commit();
}

}  // namespace dpr
