// Devices for what works on several at once.
#pragma once

#include <cstddef>
#include <vector>

#include "dpr/device.hpp"

namespace dpr::test {

/// The default device so many times; once in a simulator that cannot be used from several threads.
inline std::vector<Device> several_devices(std::size_t count) {
  const Device first = open_device();
  std::vector<Device> list{first};
  while (list.size() < count && first.info().platform != "Oclgrind") list.push_back(open_device());
  return list;
}

}  // namespace dpr::test
