#include "device/pocl_cache.hpp"

#include <fcntl.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <system_error>

namespace dpr {
namespace {

std::filesystem::path variable(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? "" : value;
}

std::filesystem::path pocl_cache() {
  if (const auto own = variable("POCL_CACHE_DIR"); !own.empty()) return own;
  if (const auto caches = variable("XDG_CACHE_HOME"); !caches.empty()) return caches / "pocl" / "kcache";
  const auto home = variable("HOME");
  return home.empty() ? std::filesystem::path("/tmp/pocl/kcache") : home / ".cache" / "pocl" / "kcache";
}

/// The reason alone.
std::string failure_of(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return error.message();
  if (faccessat(AT_FDCWD, folder.c_str(), W_OK | X_OK, AT_EACCESS) != 0)
    return std::generic_category().message(errno);
  constexpr unsigned long long k_least_bytes = 4ULL << 20;  // the sources and files of a program on their way
  struct statvfs status {};
  if (statvfs(folder.c_str(), &status) == 0 &&
      static_cast<unsigned long long>(status.f_bavail) * status.f_frsize < k_least_bytes)
    return std::generic_category().message(ENOSPC) + ", 4 MiB are needed";
  return "";
}

}  // namespace

std::string pocl_cache_failure() {
  const std::filesystem::path folder = pocl_cache();
  const std::string reason = failure_of(folder);
  if (reason.empty()) return "";
  return "PoCL cannot write to its kernel cache " + folder.string() + " (" + reason +
         "): set POCL_CACHE_DIR to a folder to which it can";
}

}  // namespace dpr
