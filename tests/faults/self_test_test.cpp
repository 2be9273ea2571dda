// The self-test of devices notices what computes wrong: with a kernel that is not run, and nothing that says
// so, its stage fails; with an OpenCL call that fails, a row says which.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

#include "support/command.hpp"

namespace self_test_test {

using namespace dpr::test;

namespace {

/// A kernel, and the rows of which one has to fail without it: what the memory held before decides which.
struct SkippedKernel {
  std::string kernel;
  std::vector<std::string> rows;
};

const std::vector<SkippedKernel> k_kernels{
    {"transform_forward", {"transform "}},
    {"shade_lit_forward", {"surface, shade "}},
    {"occupancy_forward", {"occupancy "}},
    {"gather_corners", {"rasterize, gather, backward "}},
    {"transform_backward", {"transform, backward "}},
    {"antialias_forward", {"contour, antialias, blur "}},
    {"image_loss_backward", {"image_loss, backward "}},
    {"mesh_loss_gather", {"mesh_loss, backward "}},
    {"aggregate_forward", {"aggregate "}},
    // Other kernels index by the numbers that it leaves: on a CPU the process may end.
    {"bin_fill", {"setup, bin, rasterize ", "after reduce "}},
};

Outcome check_with(const std::string& fault) {
  const TempDir folder;
  return run_program("env", folder,
                     {std::string("LD_PRELOAD=") + std::getenv("DPR_OPENCL_FAULTS"), fault,
                      program_path("DPR_CLI"), "devices", "--check", "--device", "cpu"});
}

/// The last line of what a program printed.
std::string last_line(const std::string& text) {
  const std::size_t end = text.find_last_not_of('\n');
  const std::size_t before = end == std::string::npos ? end : text.rfind('\n', end);
  return before == std::string::npos ? text : text.substr(before + 1);
}

/// True if a line that begins so says FAIL.
bool fails(const std::string& out, const std::string& row) {
  std::istringstream lines(out);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t text = line.find_first_not_of(' ');
    if (text != std::string::npos && line.compare(text, row.size(), row) == 0 &&
        line.find(" FAIL ") != std::string::npos)
      return true;
  }
  return false;
}

}  // namespace

TEST_SUITE("robustness") {
  TEST_CASE("faults: the self-test of a device fails where a kernel is not run") {
    if (is_skipped() || is_skipped("DPR_OPENCL_FAULTS")) return;
    for (const SkippedKernel& skipped : k_kernels) {
      CAPTURE(skipped.kernel);
      const Outcome outcome = check_with("DPR_SKIPPED_KERNEL=" + skipped.kernel);
      CAPTURE(outcome.out);
      CHECK(outcome.status == 2);
      // A process that ends by a signal may print too: the C library says what it found corrupted.
      CAPTURE(outcome.err);
      CHECK(is_error_line(last_line(outcome.err)));
      // The memory may have held no number before: then all of a frame's gradients are refused together.
      CHECK((std::ranges::any_of(skipped.rows, [&](const auto& row) { return fails(outcome.out, row); }) ||
             fails(outcome.out, "transform to aggregate ")));
    }
  }

  TEST_CASE("faults: the self-test of a device that fails says which call, and tries the next stages") {
    if (is_skipped() || is_skipped("DPR_OPENCL_FAULTS")) return;
    const Outcome outcome = check_with("DPR_FAULT=clEnqueueNDRangeKernel:20");
    CAPTURE(outcome.out);
    CHECK(outcome.status == 2);
    CHECK(outcome.out.find("CL_OUT_OF_RESOURCES") != std::string::npos);
    CHECK(outcome.out.find("1 failed") != std::string::npos);
  }
}

}  // namespace self_test_test
