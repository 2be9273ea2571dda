// Which device is taken, of any that a machine may have.
#include "device/choose_device.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <string>
#include <vector>

#include "dpr/error.hpp"
#include "support/messages.hpp"
#include "support/probe.hpp"

using dpr::by_preference;
using dpr::Device;
using dpr::DeviceError;
using dpr::DeviceInfo;
using dpr::matches;
using dpr::open_best;

namespace {

DeviceInfo info_of(const std::string& type, const std::string& name, bool shares_host_memory) {
  DeviceInfo info;
  info.type = type;
  info.name = name;
  info.shares_host_memory = shares_host_memory;
  return info;
}

const std::vector<DeviceInfo> k_devices{info_of("cpu", "a CPU", true),
                                        info_of("accelerator", "an FPGA", false),
                                        info_of("gpu", "an integrated GPU", true),
                                        info_of("gpu", "a GPU", false), info_of("gpu", "another GPU", false)};

/// Opens every device but those that are not usable; says which were tried.
struct Opener {
  std::vector<std::size_t> unusable;
  std::vector<std::size_t> tried = {}, opened = {};

  Device operator()(std::size_t position, bool is_tried) {
    (is_tried ? tried : opened).push_back(position);
    for (const std::size_t broken : unusable) {
      if (broken == position && position % 2 == 0) throw DeviceError(-5, "clCreateContext");
      if (broken == position) throw dpr::BuildError("scan.cl", k_devices[position].name, "", "no compiler");
    }
    return Device(dpr::open_device("cpu"));
  }
};

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("choice of a device: GPUs with memory of their own, other GPUs, accelerators, CPUs") {
    CHECK(by_preference(k_devices) == std::vector<std::size_t>{3, 4, 2, 1, 0});
    CHECK(by_preference(std::vector{k_devices[0]}) == std::vector<std::size_t>{0});
  }

  TEST_CASE("choice of a device: the best, tried first") {
    Opener opener{.unusable = {}};
    const Device device = open_best(k_devices, std::ref(opener));
    CHECK(opener.tried == std::vector<std::size_t>{3});
    CHECK(opener.opened.empty());
    CHECK(device.info().passed_over.empty());
  }

  TEST_CASE("choice of a device: what cannot be used is passed over, and named with the reason") {
    Opener opener{.unusable = {3, 4, 2}};
    const Device device = open_best(k_devices, std::ref(opener));
    CHECK(opener.tried == std::vector<std::size_t>{3, 4, 2, 1});
    CHECK(opener.opened.empty());
    const std::vector<std::string>& passed_over = device.info().passed_over;
    REQUIRE(passed_over.size() == 3);
    CHECK(passed_over[0].find("a GPU is not used: ") == 0);
    CHECK(passed_over[0].find("scan.cl") != std::string::npos);
    CHECK(passed_over[1].find("another GPU is not used: ") == 0);
    CHECK(passed_over[1].find("clCreateContext") != std::string::npos);
    CHECK(passed_over[2].find("an integrated GPU is not used: ") == 0);
  }

  TEST_CASE("choice of a device: there is no other than the last, which is not tried") {
    Opener opener{.unusable = {1, 2, 3, 4}};
    CHECK(open_best(k_devices, std::ref(opener)).info().passed_over.size() == 4);
    CHECK(opener.opened == std::vector<std::size_t>{0});
    Opener none{.unusable = {0, 1, 2, 3, 4}};
    DPR_CHECK_MESSAGE_HAS(DeviceError, open_best(k_devices, std::ref(none)), "clCreateContext");
  }

  TEST_CASE("choice of a device: by platform, name, version, type or index") {
    DeviceInfo info = info_of("gpu", "Radeon X", false);
    info.platform = "rusticl";
    info.version = "OpenCL 3.0 Mesa 24";
    info.index = 2;
    for (const char* const selector : {"radeon", "RUSTICL", "mesa 24", "gpu", "2"})
      CHECK(matches(info, selector));
    for (const char* const selector : {"cpu", "1", "nvidia", ""}) CHECK_FALSE(matches(info, selector));
    info.is_default = true;
    CHECK(matches(info, ""));
  }
}
