#include "base/child_process.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <system_error>

#include "dpr/error.hpp"

namespace dpr {
namespace {

[[noreturn]] void fail(const std::string& program, const std::string& what, int error) {
  throw IoError(program, what + ": " + std::generic_category().message(error));
}

std::vector<char*> pointers(std::vector<std::string>& words) {
  std::vector<char*> list;
  for (std::string& word : words) list.push_back(word.data());
  list.push_back(nullptr);
  return list;
}

}  // namespace

ChildProcess::ChildProcess(std::vector<std::string> words, bool takes_errors,
                           std::vector<std::string> environment) {
  std::array<int, 2> ends{};
#ifdef __APPLE__
  const int opened = pipe(ends.data());
  for (const int end : ends) fcntl(end, F_SETFD, FD_CLOEXEC);
#else
  const int opened = pipe2(ends.data(), O_CLOEXEC);  // at once: other threads may start processes
#endif
  if (opened != 0) fail(words[0], "cannot be read from", errno);
  output_.reset(fdopen(ends[0], "r"));
  posix_spawn_file_actions_t actions{};
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  if (takes_errors) posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
  const std::vector<char*> variables = pointers(environment);
  const int error = posix_spawn(&process_, words[0].c_str(), &actions, nullptr, pointers(words).data(),
                                environment.empty() ? environ : variables.data());
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  if (error != 0) fail(words[0], "cannot be run", error);
}

void ChildProcess::for_each_line(const std::function<void(std::string_view)>& take) {
  char* line = nullptr;
  std::size_t room = 0;
  for (ssize_t length = 0; (length = getline(&line, &room, output_.get())) >= 0;) {
    std::string_view text(line, static_cast<std::size_t>(length));
    if (text.ends_with('\n')) text.remove_suffix(1);
    take(text);
  }
  std::free(line);
}

int ChildProcess::wait() {
  int status = 0;
  while (waitpid(process_, &status, 0) < 0) {
    if (errno != EINTR) fail("a process", "cannot be waited for", errno);
  }
  return status;
}

}  // namespace dpr
