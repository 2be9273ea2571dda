// The command with OpenCL calls failing: status 2, one line that says what failed, and no file left behind.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstdlib>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "support/command.hpp"

using namespace dpr::test;

namespace {

constexpr const char* k_scene = R"({
  "width": 12, "height": 12,
  "camera": {"view": [[1,0,0,0],[0,1,0,0],[0,0,1,-4],[0,0,0,1]], "fov_y_degrees": 60},
  "meshes": [{"positions": [[-1,-1,0],[1,-1,0.3],[0,1,0.1],[0.9,0.8,-0.2]], "faces": [[0,1,2],[1,3,2]],
              "face_colors": [[1,0.2,0],[0.1,0.5,0.9]]}],
  "gradients": ["positions", "colors"]
})";

constexpr const char* k_views = R"({
  "width": 12, "height": 12,
  "views": [{"image": "target.exr", "camera": {"view": [[1,0,0,0],[0,1,0,0],[0,0,1,-4],[0,0,0,1]],
                                               "fov_y_degrees": 60}}]
})";

struct Command {
  std::vector<std::string> arguments;
  std::string output;
};

const std::vector<Command> k_commands{
    {{"render", "--scene", "scene.json", "-o", "out.png"}, "out.png"},
    {{"gradient", "--scene", "scene.json", "--target", "target.exr", "-o", "out.json"}, "out.json"},
    {{"pose", "--scene", "scene.json", "--target", "target.exr", "--initial-rotation", "0,0.2,0",
      "--iterations", "2", "--quiet", "-o", "out.json"},
     "out.json"},
    {{"fit", "--views", "views.json", "--iterations", "2", "--quiet", "-o", "out.obj"}, "out.obj"},
};

struct Calls {
  std::string function;
  std::size_t count;
  bool failed;
};

std::vector<Calls> read_log(const std::string& text) {
  std::vector<Calls> all;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    Calls calls;
    std::string failed;
    words >> calls.function >> calls.count >> failed;
    calls.failed = !failed.empty();
    all.push_back(calls);
  }
  return all;
}

/// Runs the command with the N-th call of a function failing; without a function, nothing fails.
Outcome run_with_fault(const TempDir& folder, const TempDir& log, const Command& command,
                       const std::string& function, std::size_t nth) {
  std::vector<std::string> arguments{std::string("LD_PRELOAD=") + std::getenv("DPR_OPENCL_FAULTS"),
                                     "DPR_FAULT_LOG=" + (log / "log").string()};
  if (!function.empty()) arguments.push_back("DPR_FAULT=" + function + ":" + std::to_string(nth));
  arguments.push_back(program_path("DPR_CLI"));
  arguments.insert(arguments.end(), command.arguments.begin(), command.arguments.end());
  return run_program("env", folder, arguments);
}

/// The text but for how long it took.
std::string without_times(const std::string& text) {
  return std::regex_replace(text, std::regex("\"seconds\": [0-9.e+-]+"), "");
}

/// Either an error and nothing else, or, where nothing depends on what failed, the result as without a fault.
void check_fault(const TempDir& folder, const Command& command, const std::string& function, std::size_t nth,
                 const std::string& expected) {
  CAPTURE(function);
  CAPTURE(nth);
  const TempDir log;
  const std::size_t entries = folder.entries();
  const Outcome outcome = run_with_fault(folder, log, command, function, nth);
  CAPTURE(outcome.err);
  const std::vector<Calls> calls = read_log(log.read("log"));
  CHECK(std::ranges::count(calls, true, &Calls::failed) == 1);
  if (outcome.status == 0) {
    CHECK(without_times(folder.read(command.output)) == expected);
    std::filesystem::remove(folder / command.output);
  } else {
    CHECK(outcome.status == 2);
    CHECK(is_error_line(outcome.err));
  }
  CHECK(folder.entries() == entries);
}

}  // namespace

TEST_SUITE("robustness") {
  TEST_CASE("faults: the command reports an OpenCL call that fails and leaves nothing behind") {
    if (is_skipped() || is_skipped("DPR_OPENCL_FAULTS")) return;
    for (const Command& command : k_commands) {
      CAPTURE(command.arguments[0]);
      const TempDir folder, log;
      folder.write("scene.json", k_scene);
      folder.write("views.json", k_views);
      REQUIRE(run_command(folder, {"render", "--scene", "scene.json", "-o", "target.exr"}).status == 0);
      const Outcome whole = run_with_fault(folder, log, command, "", 0);
      CAPTURE(whole.err);
      REQUIRE(whole.status == 0);
      const std::string expected = without_times(folder.read(command.output));
      REQUIRE(std::filesystem::remove(folder / command.output));
      const std::vector<Calls> calls = read_log(log.read("log"));
      REQUIRE(calls.size() > 10);
      for (const Calls& c : calls) {
        // The first and the last: what is set up, and what comes when much has been done.
        for (const std::size_t n : std::set<std::size_t>{1, c.count})
          check_fault(folder, command, c.function, n, expected);
      }
    }
  }
}
