// Devices for what works on several at once.
#pragma once

#include <doctest/doctest.h>

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "device/context.hpp"

namespace dpr::test {

/// The default device so many times; once in a simulator that cannot be used from several threads.
inline std::vector<Device> several_devices(std::size_t count) {
  const Device first = open_device();
  std::vector<Device> list{first};
  while (list.size() < count && first.info().platform != "Oclgrind") list.push_back(open_device());
  return list;
}

/// True if the driver, asked itself, divides the device into parts of one unit, and there are two at least.
inline bool is_divisible(const Device& device) {
  const std::array<cl_device_partition_property, 3> properties{CL_DEVICE_PARTITION_EQUALLY, 1, 0};
  cl::Device whole = impl_of(device).device;
  std::vector<cl::Device> parts;
  const int error = whole.createSubDevices(properties.data(), &parts);
  if (error == CL_SUCCESS && device.info().compute_units > 1) return true;
  MESSAGE("not divided: " << device.info().name << " of " << device.info().compute_units << " units, "
                          << std::string(cl_error_name(error)));
  return false;
}

}  // namespace dpr::test
