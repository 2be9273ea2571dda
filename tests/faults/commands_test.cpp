// The command with OpenCL calls failing: status 2, one line that says what failed, and no file left behind.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "support/command.hpp"

namespace commands_test {

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
  bool makes_folder = false;  ///< which may stay, with whole files alone
};

const std::vector<Command> k_commands{
    {{"render", "--scene", "scene.json", "-o", "out.png"}},
    {{"gradient", "--scene", "scene.json", "--target", "target.exr", "-o", "out.json"}},
    {{"pose", "--scene", "scene.json", "--target", "target.exr", "--initial-rotation", "0,0.2,0",
      "--iterations", "2", "--quiet", "-o", "out.json"}},
    {{"fit", "--views", "views.json", "--iterations", "2", "--quiet", "-o", "out.obj"}},
    {{"demo", "--size", "16x16", "--quiet", "-o", "out"}, true},
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

/// The files of a folder, by their paths in it, but for how long things took.
std::map<std::string, std::string> contents(const TempDir& folder) {
  static const std::regex times("\"seconds\": [0-9.e+-]+|[0-9.]+ seconds");
  std::map<std::string, std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder.path())) {
    if (!entry.is_regular_file()) continue;
    const std::string name = std::filesystem::relative(entry.path(), folder.path()).string();
    files[name] = std::regex_replace(folder.read(name), times, "");
  }
  return files;
}

/// The inputs of the commands, their target rendered.
void write_inputs(const TempDir& folder) {
  folder.write("scene.json", k_scene);
  folder.write("views.json", k_views);
  REQUIRE(run_command(folder, {"render", "--scene", "scene.json", "-o", "target.exr"}).status == 0);
}

/// Either an error and no file that is not whole or, where nothing depends on what failed, the result as
/// without a fault.
void check_fault(const Command& command, const std::map<std::string, std::string>& inputs,
                 const std::map<std::string, std::string>& expected, const std::string& function,
                 std::size_t nth) {
  CAPTURE(function);
  CAPTURE(nth);
  const TempDir folder, log;
  for (const auto& [name, content] : inputs) folder.write(name, content);
  const Outcome outcome = run_with_fault(folder, log, command, function, nth);
  CAPTURE(outcome.err);
  const std::vector<Calls> calls = read_log(log.read("log"));
  const auto failed = std::ranges::count(calls, true, &Calls::failed);
  // How often events are asked whether they have run is a matter of time: the last time may not come again.
  const bool is_polled = function == "clGetEventInfo";
  CHECK((failed == 1 || (is_polled && failed == 0 && outcome.status == 0)));
  const std::map<std::string, std::string> found = contents(folder);
  if (outcome.status == 0) {
    CHECK(found == expected);
    return;
  }
  CHECK(outcome.status == 2);
  CHECK(is_error_line(outcome.err));
  if (command.makes_folder) {
    CHECK(std::ranges::includes(expected, found));
  } else {
    CHECK(found == inputs);
  }
}

}  // namespace

TEST_SUITE("robustness") {
  TEST_CASE("faults: the command reports an OpenCL call that fails and leaves nothing behind") {
    if (is_skipped() || is_skipped("DPR_OPENCL_FAULTS")) return;
    for (const Command& command : k_commands) {
      CAPTURE(command.arguments[0]);
      const TempDir folder, log;
      write_inputs(folder);
      const std::map<std::string, std::string> inputs = contents(folder);
      const Outcome whole = run_with_fault(folder, log, command, "", 0);
      CAPTURE(whole.err);
      REQUIRE(whole.status == 0);
      const std::map<std::string, std::string> expected = contents(folder);
      REQUIRE(expected.size() > inputs.size());
      const std::vector<Calls> calls = read_log(log.read("log"));
      REQUIRE(calls.size() > 10);
      for (const Calls& c : calls) {
        // The first and the last: what is set up, and what comes when much has been done.
        for (const std::size_t n : std::set<std::size_t>{1, c.count})
          check_fault(command, inputs, expected, c.function, n);
      }
    }
  }
}

}  // namespace commands_test
