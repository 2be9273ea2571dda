// A program that runs in a process of its own, and the lines that it prints.
#pragma once

#include <sys/types.h>

#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

/// Declared here because macOS' unistd.h does not.
extern "C" char** environ;

namespace dpr {

class ChildProcess {
 public:
  /// Starts the program words[0], a path, with the words as its arguments and without an input. Its output
  /// comes here; its error messages too if `takes_errors`. The environment is this process' unless
  /// variables, "NAME=VALUE", are given. Throws IoError.
  explicit ChildProcess(std::vector<std::string> words, bool takes_errors = false,
                        std::vector<std::string> environment = {});

  /// Calls `take` with every line, without its end, until the program closes its output.
  void for_each_line(const std::function<void(std::string_view)>& take);
  /// Waits for the end; the status of waitpid(). Throws IoError in a process that ignores SIGCHLD.
  int wait();

 private:
  struct CloseFile {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::unique_ptr<std::FILE, CloseFile> output_;
  pid_t process_ = 0;
};

}  // namespace dpr
