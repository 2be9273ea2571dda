#include "cli/device_check.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <string>

#include "base/module.hpp"
#include "check/self_test.hpp"
#include "cli/process.hpp"
#include "dpr/error.hpp"

namespace dpr::cli {
namespace {

void print_heading() {
  std::printf("   %-34s %-46s %9s %9s %6s %7s\n", "stage", "compared", "worst", "bound", "result", "s");
}

void print(const Json& row) {
  const std::string stage = row["stage"];
  const char* result = row["passed"].get<bool>() ? "pass" : "FAIL";
  const auto number = [&](const char* name) {
    return row[name].is_number() ? row[name].get<double>() : INFINITY;
  };
  if (row.contains("error")) {
    std::printf("   %-34s %s %s\n", stage.c_str(), result, row["error"].get<std::string>().c_str());
  } else {
    std::printf("   %-34s %-46s %9.1e %9.1e %6s %7.2f\n", stage.c_str(),
                row["compared"].get<std::string>().c_str(), number("worst"), number("bound"), result,
                number("seconds"));
  }
  std::fflush(stdout);
}

Json row_to_json(const check::CheckRow& row) {
  Json json{{"stage", row.stage}, {"passed", row.passed()}, {"seconds", row.seconds}};
  if (!row.error.empty()) {
    json["error"] = row.error;
  } else {
    json["compared"] = row.compared;
    json["worst"] = row.worst;  // null where it is not finite
    json["bound"] = row.bound;
  }
  return json;
}

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

/// This program with the arguments, and what it prints.
class Child {
 public:
  explicit Child(std::array<std::string, 3> arguments) {
    std::array<int, 2> ends{};
    if (pipe(ends.data()) != 0) throw IoError("pipe", std::strerror(errno));
    for (const int end : ends) fcntl(end, F_SETFD, FD_CLOEXEC);
    output_.reset(fdopen(ends[0], "r"));
    std::string name = running_program();
    char* const words[] = {name.data(), arguments[0].data(), arguments[1].data(), arguments[2].data(),
                           nullptr};
    posix_spawn_file_actions_t actions{};
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
    const int error = posix_spawn(&process_, name.c_str(), &actions, nullptr, words, environ);
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    if (error != 0) throw IoError(name, std::string("cannot be run: ") + std::strerror(error));
  }

  void for_each_line(const std::function<void(const std::string&)>& take) {
    char* line = nullptr;
    std::size_t room = 0;
    while (getline(&line, &room, output_.get()) >= 0) take(line);
    std::free(line);
  }

  /// Waits for its end: what was unusual about it, or nothing.
  std::string ending() {
    int status = 0;
    waitpid(process_, &status, 0);
    if (WIFSIGNALED(status)) return std::string("ended by a signal: ") + strsignal(WTERMSIG(status));
    return WEXITSTATUS(status) == 0 ? "" : "ended with status " + std::to_string(WEXITSTATUS(status));
  }

 private:
  std::unique_ptr<std::FILE, CloseFile> output_;
  pid_t process_ = 0;
};

}  // namespace

DeviceCheck check_device(const DeviceInfo& info, bool prints) {
  DeviceCheck result;
  const auto add = [&](const Json& row) {
    ++result.comparisons;
    result.failed += row["passed"].get<bool>() ? 0 : 1;
    result.seconds += row["seconds"].get<double>();
    result.rows.push_back(row);
    if (prints) print(row);
  };
  if (prints) print_heading();
  Child child({"devices", "--check-rows", std::to_string(info.index)});
  child.for_each_line([&](const std::string& line) {
    const Json row = Json::parse(line, nullptr, /*allow_exceptions=*/false);
    if (row.is_object()) add(row);  // a driver may print too
  });
  if (const std::string ending = child.ending(); !ending.empty()) {
    const std::string last = result.rows.empty() ? "open" : result.rows.back()["stage"].get<std::string>();
    add({{"stage", "after " + last},
         {"passed", false},
         {"seconds", 0.0},
         {"error", "the process " + ending}});
  }
  if (prints) {
    std::printf("   %zu comparisons in %.1f s, %zu failed\n", result.comparisons, result.seconds,
                result.failed);
  }
  return result;
}

void print_check_rows(std::size_t index) {
  const auto print_row = [](const check::CheckRow& row) {
    std::printf("%s\n", row_to_json(row).dump().c_str());
    std::fflush(stdout);
  };
  try {
    check::self_test(dpr::open_device(std::to_string(index)), print_row);
  } catch (const Error& error) {
    print_row({.stage = "open", .error = error.what()});
  }
}

}  // namespace dpr::cli
