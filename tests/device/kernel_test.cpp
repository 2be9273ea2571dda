// Typed launches: a signature that differs from the kernel's source fails by name when the kernel is made, a
// program that does not build says everything a bug report needs.
#include "device/kernel.hpp"

#include <doctest/doctest.h>

#include "dpr/error.hpp"
#include "support/messages.hpp"
#include "support/probe.hpp"

namespace {

using dpr::In;
using dpr::Kernel;
using dpr::Out;
using dpr::test::device_impl;

/// Makes scan_sum, whose source says (const uint, const global uint*, global uint*), with another signature.
template <class... Args>
void make_scan_sum() {
  const Kernel<Args...> kernel(device_impl(), "scan.cl", "scan_sum");
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("a signature that is the source's is accepted, and launches") {
    Kernel<cl_uint, In<cl_uint>, Out<cl_uint>> kernel(device_impl(), "scan.cl", "scan_sum");
    const std::vector<cl_uint> values{1, 2, 3, 4};
    const dpr::Buffer<cl_uint> in(device_impl(), std::span<const cl_uint>(values));
    dpr::Buffer<cl_uint> out;
    dpr::test::poison(out, 1, 0xdeadbeefU);
    kernel(0, 4U, in, out);  // no items: nothing is launched
    CHECK(out.download() == std::vector<cl_uint>{0xdeadbeefU});
    kernel(1, 4U, in, out);
    CHECK(out.download() == std::vector<cl_uint>{10U});
  }

  TEST_CASE("a signature with another number of arguments fails by name") {
    const auto make = [] { make_scan_sum<cl_uint, In<cl_uint>>(); };
    DPR_CHECK_MESSAGE_HAS(std::logic_error, make(), "kernel scan_sum has 3 arguments, its signature 2");
  }

  TEST_CASE("a signature with another element type fails by name and place") {
    const auto make = [] { make_scan_sum<cl_uint, In<float>, Out<cl_uint>>(); };
    DPR_CHECK_MESSAGE_HAS(
        std::logic_error, make(),
        "kernel scan_sum, argument 1: the source says const uint*, the signature const float*");
  }

  TEST_CASE("a signature that writes where the source reads, or reads where it writes, fails") {
    const auto writes = [] { make_scan_sum<cl_uint, Out<cl_uint>, Out<cl_uint>>(); };
    DPR_CHECK_MESSAGE_HAS(std::logic_error, writes(),
                          "argument 1: the source says const uint*, the signature uint*");
    const auto reads = [] { make_scan_sum<cl_uint, In<cl_uint>, In<cl_uint>>(); };
    DPR_CHECK_MESSAGE_HAS(std::logic_error, reads(),
                          "argument 2: the source says uint*, the signature const uint*");
  }

  TEST_CASE("a signature with a value for a buffer, or another struct, fails") {
    const auto value = [] { make_scan_sum<cl_uint, cl_uint, Out<cl_uint>>(); };
    DPR_CHECK_MESSAGE_HAS(std::logic_error, value(),
                          "argument 1: the source says const uint*, the signature uint");
    const auto other_struct = [] {
      const Kernel<dpr::shared::ViewParams, In<cl_uint>, In<cl_uint2>, Out<cl_uint>> kernel(
          device_impl(), "rasterize.cl", "rasterize_count");
    };
    DPR_CHECK_MESSAGE_HAS(
        std::logic_error, other_struct(),
        "kernel rasterize_count, argument 0: the source says FrameParams, the signature ViewParams");
  }

  TEST_CASE("a kernel that the program does not have fails by name") {
    const auto make = [] { const Kernel<cl_uint> kernel(device_impl(), "scan.cl", "scan_nothing"); };
    try {
      make();
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
