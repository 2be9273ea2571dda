#include "cli/device_check.hpp"

#include <sys/wait.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <string>

#include "base/child_process.hpp"
#include "base/module.hpp"
#include "check/self_test.hpp"
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

/// The end of a process in words; empty where it succeeded.
std::string describe_end(int status) {
  if (WIFSIGNALED(status)) return std::string("ended by a signal: ") + strsignal(WTERMSIG(status));
  return WEXITSTATUS(status) == 0 ? "" : "ended with status " + std::to_string(WEXITSTATUS(status));
}

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
  ChildProcess child({running_program(), "devices", "--check-rows", std::to_string(info.index)});
  child.for_each_line([&](std::string_view line) {
    const Json row = Json::parse(line, nullptr, /*allow_exceptions=*/false);
    if (row.is_object()) add(row);  // a driver may print too
  });
  if (const std::string ending = describe_end(child.wait()); !ending.empty()) {
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
