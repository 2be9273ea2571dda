// Which device is taken, of any that a machine may have.
#include "device/choose_device.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "dpr/error.hpp"
#include "dpr/multi_device.hpp"
#include "support/messages.hpp"
#include "support/several_devices.hpp"

namespace choose_device_test {

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

  TEST_CASE("choice of a device: among equals the fastest, where the time of a frame is known of all") {
    std::vector<DeviceInfo> devices = k_devices;
    devices[3].frame_milliseconds = 5;
    CHECK(dpr::best_equals(devices) == std::vector<std::size_t>{3, 4});
    CHECK(by_preference(devices) == std::vector<std::size_t>{3, 4, 2, 1, 0});
    CHECK(dpr::reason_of_preference(devices[3], devices) == "the first GPU with memory of its own");
    devices[4].frame_milliseconds = 2;
    devices[0].frame_milliseconds = 1;
    CHECK(by_preference(devices) == std::vector<std::size_t>{4, 3, 2, 1, 0});
    CHECK(dpr::reason_of_preference(devices[4], devices) == "the fastest GPU with memory of its own");
    CHECK(dpr::reason_of_preference(devices[0], devices) == "the first CPU: there is no GPU or accelerator");
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

  TEST_CASE(
      "lists of devices: each item takes the next that matches; parts; names that hold commas or slashes") {
    std::vector<DeviceInfo> devices = k_devices;
    devices.push_back(info_of("gpu", "Radeon (renoir, LLVM 15)", false));
    devices[0].compute_units = 4;
    for (std::size_t i = 0; i < devices.size(); ++i) devices[i].index = i;
    devices[1].version = "OpenCL 1.2 PoCL-Remote 10.0.0.2:7777/0";
    const auto positions = [&](const std::string& selectors) {
      std::vector<std::size_t> list;
      for (const dpr::DeviceChoice& choice : dpr::choose_devices(devices, selectors, "device")) {
        for (unsigned part = 0; part < choice.parts; ++part) list.push_back(choice.position);
      }
      return list;
    };
    using List = std::vector<std::size_t>;
    CHECK(positions("0,3") == List{0, 3});
    CHECK(positions("0, gpu") == List{0, 2});
    CHECK(positions("gpu,gpu,gpu") == List{2, 3, 4});
    CHECK(positions("another,cpu/2,7777/0") == List{4, 0, 0, 1});
    CHECK(positions("cpu/4") == List{0, 0, 0, 0});
    for (const char* const one : {"cpu", "renoir, LLVM", "7777/0", "2"})
      CHECK_FALSE(dpr::names_several(devices, one));
    for (const char* const several : {"cpu,2", "cpu/2", "gpu,gpu"})
      CHECK(dpr::names_several(devices, several));
    CHECK_FALSE(dpr::names_several(devices, "nothing"));
    const auto refuses = [&](const char* selectors, const char* word) {
      DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, positions(selectors), word);
    };
    refuses("cpu,cpu",
            "got 'cpu' in 'cpu,cpu', expected no more such devices than there are: 0 (cpu, a CPU), 1");
    refuses("accelerator,cpu",
            "got 'accelerator' in 'accelerator,cpu', expected devices that are there: 0 (cpu");
    refuses("cpu,,gpu", "one is empty");
    refuses("cpu,", "one is empty");
    refuses("cpu/5", "1 to 4 parts");
    refuses("0,nothing/2", "'nothing/2'");
    refuses("cpu/0", "'cpu/0'");
  }

  TEST_CASE("lists of devices are opened, parts of the CPU too; one device is refused in their place") {
    CHECK(dpr::open_devices("cpu").size() == 1);
    const Device cpu = dpr::open_device("cpu");
    const unsigned units = cpu.info().compute_units;
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::open_devices("cpu/" + std::to_string(units + 1)),
                          "compute units for this process");
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::open_device("cpu/2"), "one device, not a list");
    if (units < 2) return;
    if (!dpr::test::is_divisible(cpu)) {
      DPR_CHECK_MESSAGE_HAS(DeviceError, dpr::open_devices("cpu/2"),
                            "clCreateSubDevices of " + cpu.info().name +
                                ", which its driver does not divide: got CL_DEVICE_PARTITION_FAILED");
      return;
    }
    const std::vector<Device> halves = dpr::open_devices("cpu/2");
    REQUIRE(halves.size() == 2);
    CHECK(halves[0].info().compute_units == units / 2);
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

}  // namespace choose_device_test
