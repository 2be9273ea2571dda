#include "cli/device_check.hpp"

#include <cstdio>
#include <string>

#include "check/self_test.hpp"
#include "dpr/error.hpp"

namespace dpr::cli {
namespace {

void print_heading() {
  std::printf("   %-34s %-46s %9s %9s %6s %7s\n", "stage", "compared", "worst", "bound", "result", "s");
}

void print(const check::CheckRow& row) {
  const char* result = row.passed() ? "pass" : "FAIL";
  if (row.error.empty()) {
    std::printf("   %-34s %-46s %9.1e %9.1e %6s %7.2f\n", row.stage.c_str(), row.compared.c_str(), row.worst,
                row.bound, result, row.seconds);
  } else {
    std::printf("   %-34s %s %s\n", row.stage.c_str(), result, row.error.c_str());
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

}  // namespace

DeviceCheck check_device(const DeviceInfo& info, bool prints) {
  DeviceCheck result;
  const auto add = [&](const check::CheckRow& row) {
    ++result.comparisons;
    result.failed += row.passed() ? 0 : 1;
    result.seconds += row.seconds;
    result.rows.push_back(row_to_json(row));
    if (prints) print(row);
  };
  if (prints) print_heading();
  try {
    check::self_test(dpr::open_device(std::to_string(info.index)), add);
  } catch (const Error& error) {
    add({.stage = "open", .error = error.what()});
  }
  if (prints) {
    std::printf("   %zu comparisons in %.1f s, %zu failed\n", result.comparisons, result.seconds,
                result.failed);
  }
  return result;
}

}  // namespace dpr::cli
