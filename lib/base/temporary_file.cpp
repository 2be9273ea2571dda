#include "base/temporary_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdio>
#include <cstring>
#include <mutex>
#include <random>
#include <set>
#include <string>
#include <string_view>
#include <system_error>

namespace dpr {
namespace {

// Names: ".dpr-0123456789abcdef.tmp".
constexpr std::string_view k_prefix = ".dpr-", k_suffix = ".tmp", k_digits = "0123456789abcdef";

std::string unlikely_name() {
  std::random_device random;
  std::string name(k_prefix);
  for (int i = 0; i < 16; ++i) name += k_digits[random() % k_digits.size()];
  return name.append(k_suffix);
}

bool is_temporary_name(std::string_view name) {
  if (name.size() != k_prefix.size() + 16 + k_suffix.size()) return false;
  if (!name.starts_with(k_prefix) || !name.ends_with(k_suffix)) return false;
  return name.substr(k_prefix.size(), 16).find_first_not_of(k_digits) == std::string_view::npos;
}

// The paths that a signal handler removes. In static memory, because a handler can neither take a lock nor
// trust the heap. A file that finds no slot free is left to a later run.
struct Slot {
  enum State { unused, changing, used };
  std::atomic<int> state{unused};
  std::array<char, PATH_MAX> path{};
};
static_assert(std::atomic<int>::is_always_lock_free);
std::array<Slot, 32> g_slots;

int take_slot(const std::string& path) {
  if (path.size() >= PATH_MAX) return -1;
  for (std::size_t i = 0; i < g_slots.size(); ++i) {
    int expected = Slot::unused;
    if (!g_slots[i].state.compare_exchange_strong(expected, Slot::changing)) continue;
    std::strcpy(g_slots[i].path.data(), path.c_str());
    g_slots[i].state = Slot::used;
    return static_cast<int>(i);
  }
  return -1;
}

// A slot that a handler has taken stays its own.
void release_slot(int slot) {
  int expected = Slot::used;
  if (slot >= 0)
    g_slots[static_cast<std::size_t>(slot)].state.compare_exchange_strong(expected, Slot::unused);
}

bool is_locked_by_another(int descriptor) {
  return flock(descriptor, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
}

bool is_linked(int descriptor) {
  struct stat status {};
  return fstat(descriptor, &status) == 0 && status.st_nlink > 0;
}

// A file that nobody has locked was left by a process that is gone: locks end with their process, on whatever
// machine it was. Where the file system has no locks, none can be taken, and the file stays.
void remove_if_stale(const std::filesystem::path& file) {
  const int descriptor = open(file.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (descriptor < 0) return;
  struct stat status {};
  if (fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode) &&
      flock(descriptor, LOCK_EX | LOCK_NB) == 0) {
    unlink(file.c_str());
  }
  close(descriptor);
}

void remove_stale_files(const std::filesystem::path& folder) {
  static std::mutex mutex;
  static std::set<std::filesystem::path> seen;  // a folder of many files is searched once
  const std::lock_guard lock(mutex);
  if (!seen.insert(folder).second) return;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    if (is_temporary_name(entry->path().filename().native())) remove_if_stale(entry->path());
  }
}

}  // namespace

TemporaryFile::TemporaryFile(const std::filesystem::path& folder) {
  const std::filesystem::path absolute = std::filesystem::absolute(folder);
  remove_stale_files(absolute);
  for (;;) {
    path_ = absolute / unlikely_name();
    slot_ = take_slot(path_.native());
    descriptor_ = open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    const int error = errno;
    // Between its making and its locking another process may have taken the file for a stale one.
    if (descriptor_ >= 0 && !is_locked_by_another(descriptor_) && is_linked(descriptor_)) return;
    release_slot(slot_);
    if (descriptor_ >= 0) {
      close(descriptor_);
    } else if (error != EEXIST) {
      throw std::system_error(error, std::generic_category());
    }
  }
}

TemporaryFile::~TemporaryFile() {
  if (!path_.empty()) unlink(path_.c_str());
  release_slot(slot_);
  close(descriptor_);
}

void TemporaryFile::rename_to(const std::filesystem::path& file) {
  if (rename(path_.c_str(), file.c_str()) != 0) throw std::system_error(errno, std::generic_category());
  path_.clear();
}

void remove_temporary_files() noexcept {
  for (Slot& slot : g_slots) {
    int expected = Slot::used;
    if (slot.state.compare_exchange_strong(expected, Slot::changing)) unlink(slot.path.data());
  }
}

}  // namespace dpr
