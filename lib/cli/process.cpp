#include "cli/process.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <iostream>
#include <system_error>

#include "base/temporary_file.hpp"
#include "dpr/error.hpp"

namespace dpr::cli {
namespace {

// The default action is back (SA_RESETHAND), and ends the process as if nobody had handled the signal.
void clean_up(int signal) {
  remove_temporary_files();
  raise(signal);
}

// Signals that are ignored stay so: nohup and shells without job control ask for it.
void clean_up_on(int signal) {
  struct sigaction action {};
  if (sigaction(signal, nullptr, &action) != 0 || action.sa_handler == SIG_IGN) return;
  action = {};
  action.sa_handler = clean_up;
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  sigaction(signal, &action, nullptr);
}

}  // namespace

void prepare_process() {
  // Opened the other way round, so that whoever uses them gets an error.
  const int directions[] = {O_WRONLY, O_RDONLY, O_RDONLY};
  for (int stream = 0; stream < 3; ++stream) {
    if (fcntl(stream, F_GETFD) < 0 && open("/dev/null", directions[stream]) < 0) std::perror("/dev/null");
  }
  std::signal(SIGXFSZ, SIG_IGN);
  for (const int signal : {SIGHUP, SIGINT, SIGTERM, SIGPIPE, SIGXCPU}) clean_up_on(signal);
}

void require_printed() {
  errno = 0;
  std::cout.flush();
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && std::cout) return;
  const int reason = errno != 0 ? errno : EIO;  // an earlier part may be lost
  throw IoError("standard output", "cannot be written: " + std::generic_category().message(reason));
}

}  // namespace dpr::cli
