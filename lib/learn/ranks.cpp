#include "learn/ranks.hpp"

#include <arpa/inet.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "base/input_file.hpp"
#include "dpr/error.hpp"

namespace dpr::learn {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int k_most_ranks = 1024;  // as many as a batch has images

/// A variable, or the one that Slurm sets instead.
struct Variable {
  const char* name;
  const char* slurm = nullptr;
};

std::optional<std::string> find(const Environment& environment, const Variable& variable) {
  if (const char* value = environment(variable.name)) return value;
  if (const char* value = variable.slurm != nullptr ? environment(variable.slurm) : nullptr) return value;
  return {};
}

std::string require(const Environment& environment, const Variable& variable) {
  const auto value = find(environment, variable);
  if (value && !value->empty()) return *value;
  throw InvalidArgument(
      std::string(variable.name) + " (environment)", "nothing",
      "a value: RANK, WORLD_SIZE, MASTER_ADDR and MASTER_PORT are set together, as torchrun "
      "does, or none of them");
}

int require_number(const Environment& environment, const Variable& variable, int least, int most) {
  const std::string text = require(environment, variable);
  int number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error == std::errc() && end == text.data() + text.size() && number >= least && number <= most)
    return number;
  throw InvalidArgument(std::string(variable.name) + " (environment)", "\"" + text + "\"",
                        std::to_string(least) + " to " + std::to_string(most));
}

/// The words of /proc/self/cmdline.
std::vector<std::string> own_arguments() {
  std::vector<std::string> words;
  const std::string line = read_file("/proc/self/cmdline");
  for (std::size_t first = 0; first < line.size(); first = line.find('\0', first) + 1)
    words.emplace_back(line.c_str() + first);
  return words;
}

/// A port of this machine that nobody listens at now.
std::uint16_t free_port() {
  const int descriptor = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  auto* const generic = reinterpret_cast<sockaddr*>(&address);
  socklen_t size = sizeof address;
  const bool found =
      descriptor >= 0 && bind(descriptor, generic, size) == 0 && getsockname(descriptor, generic, &size) == 0;
  const int reason = errno;
  if (descriptor >= 0) close(descriptor);
  if (!found) throw Error(std::string("ranks (dpr learn): no port is free: ") + std::strerror(reason));
  return ntohs(address.sin_port);
}

/// Puts into the environment what a rank is told.
void set_environment(int rank, int count, std::uint16_t port) {
  const std::string threads =
      std::to_string(std::max(1U, std::thread::hardware_concurrency() / static_cast<unsigned>(count)));
  for (const char* variable : {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "POCL_MAX_PTHREAD_COUNT"})
    setenv(variable, threads.c_str(), 0);
  setenv("RANK", std::to_string(rank).c_str(), 1);
  setenv("LOCAL_RANK", std::to_string(rank).c_str(), 1);
  setenv("WORLD_SIZE", std::to_string(count).c_str(), 1);
  setenv("MASTER_ADDR", "127.0.0.1", 1);
  setenv("MASTER_PORT", std::to_string(port).c_str(), 1);
}

/// A rank that this process started.
struct Child {
  int rank = 0;
  pid_t id = 0;
  int messages = -1;  // what it prints on stderr
  std::optional<int> status;

  bool has_failed() const { return status && (!WIFEXITED(*status) || WEXITSTATUS(*status) != 0); }
  std::string text() const {
    std::string bytes(static_cast<std::size_t>(lseek(messages, 0, SEEK_END)), '\0');
    const ssize_t count = pread(messages, bytes.data(), bytes.size(), 0);
    return bytes.substr(0, static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
  }
  bool is_consequence() const {
    return WIFEXITED(*status) && text().find(k_lost_contact) != std::string::npos;
  }
};

/// Starts this program with the same arguments and the environment as it is.
Child start(int rank) {
  constexpr char k_failure[] = "dpr: error: ranks (dpr learn): this program cannot be run again\n";
  std::vector<std::string> words = own_arguments();
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  Child child{rank, -1, memfd_create("stderr", MFD_CLOEXEC), {}};
  const pid_t parent = getpid();
  if (child.messages >= 0) child.id = fork();
  if (child.id < 0) throw Error(std::string("ranks (dpr learn): no process: ") + std::strerror(errno));
  if (child.id == 0) {  // nothing here may allocate: this process may have threads
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() == parent && dup2(child.messages, STDERR_FILENO) >= 0) execv("/proc/self/exe", argv.data());
    const ssize_t written = write(STDERR_FILENO, k_failure, sizeof k_failure - 1);
    _exit(written > 0 ? 1 : 2);
  }
  return child;
}

class Children {
 public:
  Children(int count, std::uint16_t port) {
    for (int rank = 0; rank < count; ++rank) {
      set_environment(rank, count, port);
      children_.push_back(start(rank));
    }
  }
  ~Children() {
    end();
    for (const Child& child : children_) close(child.messages);
  }
  Children(const Children&) = delete;
  Children& operator=(const Children&) = delete;

  const std::vector<Child>& all() const { return children_; }

  /// Waits until all have ended, or one has failed: that one, or null.
  const Child* wait() {
    while (is_running()) {
      const Child* ended = reap(0);
      if (ended != nullptr && ended->has_failed()) return ended;
    }
    return nullptr;
  }

  /// Waits until all have ended, or one has as wanted, but no longer than this: that one, or null.
  template <typename Predicate>
  const Child* wait_for(Clock::duration time, Predicate wanted) {
    constexpr auto k_pause = std::chrono::milliseconds(10);
    for (const auto deadline = Clock::now() + time; is_running() && Clock::now() < deadline;) {
      const Child* ended = reap(WNOHANG);
      if (ended != nullptr && wanted(*ended)) return ended;
      if (ended == nullptr) std::this_thread::sleep_for(k_pause);
    }
    return nullptr;
  }

  /// Ends those that still run, by a signal that lets them remove their temporary files, or else at once.
  void end() {
    constexpr auto k_time_to_clean_up = std::chrono::seconds(2);
    send(SIGTERM);
    send(SIGCONT);  // one that was stopped could not handle it
    wait_for(k_time_to_clean_up, [](const Child&) { return false; });
    send(SIGKILL);
    while (is_running()) reap(0);
  }

 private:
  bool is_running() const {
    return std::ranges::any_of(children_, [](const Child& child) { return !child.status; });
  }

  void send(int signal) const {
    for (const Child& child : children_) {
      if (!child.status) kill(child.id, signal);
    }
  }

  const Child* reap(int options) {
    int status = 0;
    const pid_t id = waitpid(-1, &status, options);
    const auto found = std::ranges::find(children_, id, &Child::id);
    if (id <= 0 || found == children_.end()) return nullptr;
    found->status = status;
    return &*found;
  }

  std::vector<Child> children_;
};

/// Prints why a rank failed; the status for this process.
int report(const Child& child, std::size_t count) {
  const std::string text = child.text();
  std::fflush(stdout);
  std::fwrite(text.data(), 1, text.size(), stderr);
  if (WIFEXITED(*child.status)) return WEXITSTATUS(*child.status);
  std::fprintf(stderr,
               "dpr: error: rank %d of %zu (dpr learn): got signal %d (%s), expected its end; the last "
               "checkpoint stands, and the same command goes on from it\n",
               child.rank, count, WTERMSIG(*child.status), strsignal(WTERMSIG(*child.status)));
  return 1;
}

}  // namespace

Ranks ranks_of(const Environment& environment) {
  constexpr Variable k_rank{"RANK", "SLURM_PROCID"}, k_size{"WORLD_SIZE", "SLURM_NTASKS"},
      k_local{"LOCAL_RANK", "SLURM_LOCALID"}, k_address{"MASTER_ADDR"}, k_port{"MASTER_PORT"};
  constexpr int k_most_ports = 65535;
  // Slurm's variables alone are no request, because Slurm sets them in every job.
  const bool is_alone = std::ranges::none_of(
      std::initializer_list<const char*>{k_rank.name, k_size.name, k_address.name, k_port.name},
      [&](const char* name) { return environment(name) != nullptr; });
  if (is_alone) return {};
  Ranks ranks;
  ranks.count = require_number(environment, k_size, 1, k_most_ranks);
  ranks.rank = require_number(environment, k_rank, 0, ranks.count - 1);
  if (find(environment, k_local)) ranks.local_rank = require_number(environment, k_local, 0, ranks.count - 1);
  ranks.address = require(environment, k_address);
  ranks.port = static_cast<std::uint16_t>(require_number(environment, k_port, 1, k_most_ports));
  const char* const agent = environment("TORCHELASTIC_USE_AGENT_STORE");
  ranks.launcher_listens = agent != nullptr && std::string_view(agent) == "True";
  if (const char* restarts = environment("TORCHELASTIC_RESTART_COUNT")) ranks.restarts = restarts;
  return ranks;
}

int run_ranks(int count) {
  constexpr auto k_time_for_a_cause = std::chrono::seconds(2);
  if (count < 2 || count > k_most_ranks) {
    throw InvalidArgument("ranks (dpr learn)", std::to_string(count), "2 to " + std::to_string(k_most_ranks));
  }
  Children children(count, free_port());
  const Child* failed = children.wait();
  if (failed == nullptr) {
    for (const Child& child : children.all()) std::fputs(child.text().c_str(), stderr);
    return 0;
  }
  // The others notice that it is gone; it may itself have noticed that another one is.
  if (failed->is_consequence()) {
    const auto is_cause = [](const Child& child) { return child.has_failed() && !child.is_consequence(); };
    if (const Child* cause = children.wait_for(k_time_for_a_cause, is_cause)) failed = cause;
  }
  const int status = report(*failed, children.all().size());
  children.end();
  return status;
}

}  // namespace dpr::learn
