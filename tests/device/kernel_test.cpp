// Launches, and programs that do not build, which say everything that a bug report needs.
#include "device/kernel.hpp"

#include <doctest/doctest.h>

#include "dpr/error.hpp"
#include "kernels/scan.hpp"
#include "support/messages.hpp"
#include "support/probe.hpp"

namespace kernel_test {

namespace {

using dpr::test::device_impl;

/// No kernel of its file.
struct scan_nothing : dpr::kernel::scan_sum {
  static constexpr dpr::KernelSource k_source{"scan.cl", "scan_nothing"};
};

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("a kernel is launched with its arguments, over no items not at all") {
    dpr::Launcher<dpr::kernel::scan_apply, dpr::kernel::scan_sum> launch(device_impl());
    const std::vector<cl_uint> values{1, 2, 3, 4}, four{4};
    const dpr::Buffer<cl_uint> in(device_impl(), std::span<const cl_uint>(values)),
        present(device_impl(), std::span<const cl_uint>(four));
    dpr::Buffer<cl_uint> out;
    dpr::test::poison(out, 1, 0xdeadbeefU);
    const dpr::kernel::scan_sum sum{.count = 4U, .present = present, .values = in, .sums = out};
    launch(0, sum);
    CHECK(out.download() == std::vector<cl_uint>{0xdeadbeefU});
    launch(1, sum);
    CHECK(out.download() == std::vector<cl_uint>{10U});
  }

  TEST_CASE("a kernel that the program does not have fails by name") {
    try {
      const dpr::Launcher<scan_nothing> launch(device_impl());
      FAIL("no exception");
    } catch (const dpr::DeviceError& error) {
      CHECK(error.code() == CL_INVALID_KERNEL_NAME);
      CHECK(dpr::test::contains(error.what(), "scan_nothing"));
      CHECK(dpr::test::contains(error.what(), "CL_INVALID_KERNEL_NAME"));
    }
  }

  TEST_CASE("a program that does not build names program, device and options, and keeps the log") {
    const std::string options = dpr::build_options(device_impl(), " -DDPR_SCAN_CHUNK=undeclared_name");
    try {
      device_impl().program("scan.cl", options);
      FAIL("no exception");
    } catch (const dpr::BuildError& error) {
      CHECK(error.device() == device_impl().info.name);
      CHECK(error.options() == options);
      CHECK(dpr::test::contains(error.log(), "undeclared_name"));
      CHECK(dpr::test::contains(error.what(), "scan.cl"));
      CHECK(!dpr::test::contains(error.what(), "\n"));
    }
    // The failure is not kept: the same file builds with good options.
    CHECK_NOTHROW(device_impl().program("scan.cl", dpr::build_options(device_impl())));
  }

  TEST_CASE("a program is built once for each set of options") {
    const cl_program first = device_impl().program("scan.cl", dpr::build_options(device_impl()))();
    const cl_program again = device_impl().program("scan.cl", dpr::build_options(device_impl()))();
    const cl_program other =
        device_impl().program("scan.cl", dpr::build_options(device_impl(), " -DDPR_SCAN_CHUNK=128"))();
    CHECK(first == again);
    CHECK(first != other);
  }

  TEST_CASE("a file that is not embedded is a fault of the program, by name") {
    DPR_CHECK_MESSAGE_HAS(std::logic_error, dpr::kernel_file("nothing.cl"), "nothing.cl");
  }
}

}  // namespace kernel_test
