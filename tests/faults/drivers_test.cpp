// Drivers that abort, devices of which one is preferred, and caches that cannot be written: the command says
// so in a line, and goes on with what is left.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <regex>
#include <string>
#include <vector>

#include "support/command.hpp"
#include "support/messages.hpp"

namespace drivers_test {

using namespace dpr::test;

namespace {

constexpr const char* k_scene = R"({
  "width": 12, "height": 12,
  "camera": {"view": [[1,0,0,0],[0,1,0,0],[0,0,1,-4],[0,0,0,1]], "fov_y_degrees": 60},
  "meshes": [{"positions": [[-1,-1,0],[1,-1,0.3],[0,1,0.1]], "faces": [[0,1,2]], "face_colors": [[1,0.2,0]]}]
})";

/// A folder with a scene, and what is remembered of devices.
struct Machine {
  Machine() { folder.write("scene.json", k_scene); }

  /// dpr render with variables of the environment.
  Outcome render(std::vector<std::string> variables, const std::vector<std::string>& options = {}) const {
    variables.push_back("DPR_CACHE_DIR=" + (folder / "cache").string());
    variables.push_back(program_path("DPR_CLI"));
    for (const char* const word : {"render", "--scene", "scene.json", "-o", "out.png"})
      variables.emplace_back(word);
    variables.insert(variables.end(), options.begin(), options.end());
    return run_program("env", folder, variables);
  }

  /// The same with trials, on a driver that aborts.
  Outcome render_with(const std::string& limits, std::vector<std::string> variables = {}) const {
    variables.push_back(std::string("LD_PRELOAD=") + std::getenv("DPR_SMALL_DEVICE_LIBRARY"));
    variables.push_back("DPR_SMALL_DEVICE=" + limits);
    variables.insert(variables.begin(), "DPR_TRIAL=on");  // unless they say otherwise
    return render(variables);
  }

  TempDir folder;
};

std::size_t lines_of(const std::string& text) {
  return static_cast<std::size_t>(std::ranges::count(text, '\n'));
}

bool is_skipped_here() { return is_skipped() || is_skipped("DPR_SMALL_DEVICE_LIBRARY"); }

}  // namespace

TEST_SUITE("robustness") {
  TEST_CASE(
      "drivers: one that aborts in the third kernel is noted, with kernel and lanes, and used otherwise") {
    if (is_skipped_here()) return;
    const Machine machine;
    for (int start = 0; start < 2; ++start) {
      const Outcome outcome = machine.render_with("abort=3:16", {"DPR_DEVICE=cpu"});
      CAPTURE(outcome.err);
      CHECK(outcome.status == 0);
      CHECK(std::filesystem::exists(machine.folder / "out.png"));
      if (outcome.err.empty()) return;  // a CPU of narrower vectors
      CHECK(lines_of(outcome.err) == 1);
      const std::regex note(
          "dpr: note: .* \\(.*, driver .*\\) is not used with 16 lanes: its driver ends the process at "
          "[a-z_]+, Aborted \\(LLVM ERROR: .*\\)\n");
      CHECK(std::regex_match(outcome.err, note));
    }
  }

  TEST_CASE("drivers: one that aborts at every width is an error of one line") {
    if (is_skipped_here()) return;
    const Machine machine;
    for (int start = 0; start < 2; ++start) {
      const Outcome outcome = machine.render_with("abort=3");
      CAPTURE(outcome.err);
      CHECK(outcome.status == 2);
      CHECK(is_error_line(outcome.err));
      CHECK(contains(outcome.err, "ends the process at "));
      CHECK_FALSE(std::filesystem::exists(machine.folder / "out.png"));
    }
  }

  TEST_CASE("drivers: one that hangs in a kernel is left there, and is an error of one line") {
    if (is_skipped_here()) return;
    const Machine machine;
    for (int start = 0; start < 2; ++start) {
      const Outcome outcome = machine.render_with("hang=3", {"DPR_TRIAL_SECONDS=2", "DPR_LANES=8"});
      CAPTURE(outcome.err);
      CHECK(outcome.status == 2);
      CHECK(is_error_line(outcome.err));
      CHECK(contains(outcome.err, "with 8 lanes: its driver does not finish "));
    }
  }

  TEST_CASE("drivers: the width that the environment wants is the only one that is tried") {
    if (is_skipped_here()) return;
    const Outcome outcome = Machine().render_with("abort=3:8", {"DPR_LANES=8"});
    CAPTURE(outcome.err);
    CHECK(outcome.status == 2);
    CHECK(is_error_line(outcome.err));
    CHECK(contains(outcome.err, "with 8 lanes"));
  }

  TEST_CASE("drivers: a trial is made once") {
    if (is_skipped_here()) return;
    const Machine machine;
    // The trial launches the kernels of backward passes too, the command those of an image: where the driver
    // aborts at a kernel that no image needs, only a trial can tell.
    CHECK(machine.render({"DPR_TRIAL=on"}).status == 0);
    const Outcome known = machine.render_with("abort=40");
    CAPTURE(known.err);
    CHECK(known.status == 0);
    CHECK(known.err.empty());
    const Outcome unknown = Machine().render_with("abort=40");
    CAPTURE(unknown.err);
    CHECK(contains(unknown.err, "ends the process at "));
  }

  TEST_CASE("drivers: of two devices the first that is preferred is used, in groups of the kernel's size") {
    if (is_skipped_here()) return;
    const Machine machine;
    for (const char* const lanes : {"DPR_LANES=1", "DPR_LANES=8"}) {
      const Outcome outcome =
          machine.render({lanes, "POCL_DEVICES=pthread basic", "DPR_DEVICE="}, {"--verbose"});
      CAPTURE(outcome.out);
      CAPTURE(outcome.err);
      CHECK(outcome.status == 0);
      CHECK(outcome.err.empty());
      CHECK(contains(outcome.out, "device 0: "));
    }
  }

  TEST_CASE("drivers: of two devices of a kind the faster is the default, from the first start on") {
    if (is_skipped_here()) return;
    const Machine machine;
    const std::vector<std::string> two{"POCL_DEVICES=pthread basic", "DPR_DEVICE=", "DPR_TRIAL=on"};
    const Outcome first = machine.render(two, {"--verbose"}), second = machine.render(two, {"--verbose"});
    CAPTURE(first.err);
    CHECK(first.status == 0);
    CHECK(first.out.substr(0, 9) == second.out.substr(0, 9));
    std::vector<std::string> list = two;
    list.push_back("DPR_CACHE_DIR=" + (machine.folder / "cache").string());
    list.push_back(program_path("DPR_CLI"));
    list.emplace_back("devices");
    const Outcome devices = run_program("env", machine.folder, list);
    CAPTURE(devices.out);
    CHECK(contains(devices.out, "the fastest CPU"));
    CHECK(contains(devices.out, "small frame"));
  }

  TEST_CASE("drivers: a kernel that runs in smaller groups than it asks for is built for those, or refused") {
    if (is_skipped_here()) return;
    const auto render_with = [](const std::string& limits) {
      return Machine().render({std::string("LD_PRELOAD=") + std::getenv("DPR_SMALL_DEVICE_LIBRARY"),
                               "DPR_SMALL_DEVICE=" + limits, "DPR_LANES=1", "DPR_DEVICE=cpu"});
    };
    for (const char* const limits : {"group=32", "few=16:setup_forward", "few=3:transform_forward"}) {
      const Outcome outcome = render_with(limits);
      CAPTURE(outcome.err);
      CHECK(outcome.status == 0);
      CHECK(outcome.err.empty());
    }
    for (const char* const limits : {"group=8", "few=8:setup_forward"}) {
      const Outcome outcome = render_with(limits);
      CAPTURE(outcome.err);
      CHECK(outcome.status == 2);
      CHECK(is_error_line(outcome.err));
      CHECK(contains(outcome.err, "at most 8 work-items"));
    }
  }

  TEST_CASE("drivers: what a driver says of a kernel's arguments is never asked") {
    if (is_skipped() || is_skipped("DPR_OPENCL_FAULTS")) return;
    const Outcome outcome = Machine().render({std::string("LD_PRELOAD=") + std::getenv("DPR_OPENCL_FAULTS"),
                                              "DPR_FAULT=clGetKernelArgInfo:1", "DPR_DEVICE=cpu"});
    CHECK(outcome.status == 0);
  }

  TEST_CASE("drivers: PoCL's cache that cannot be written is named") {
    if (is_skipped()) return;
    const Outcome outcome = Machine().render({"POCL_CACHE_DIR=/dev/null/cache", "DPR_DEVICE="});
    CAPTURE(outcome.err);
    if (outcome.status == 0) return;  // there is another device
    CHECK(outcome.status == 2);
    CHECK(is_error_line(outcome.err));
    CHECK(contains(outcome.err, "/dev/null/cache"));
    CHECK(contains(outcome.err, "POCL_CACHE_DIR"));
  }
}

}  // namespace drivers_test
