// Queries of OpenCL objects.
#pragma once

#include <cfenv>
#include <future>
#include <string_view>

#include "device/context.hpp"

namespace dpr {

/// A property of an object. Throws DeviceError where it does not answer; `call` is what was asked.
template <auto property, typename Object>
auto cl_info(const Object& object, std::string_view call) {
  int error = CL_SUCCESS;
  auto value = object.template getInfo<property>(&error);
  check_cl(error, call);
  return value;
}

/// Runs a driver's long work on a thread of the library's own, and waits for it. The caller's may have a
/// small stack, of which PoCL's first question takes 64 kB and a compiler any number, or floating-point
/// traps, which the threads that a driver starts would take over.
template <typename Work>
auto on_own_thread(const Work& work) {
  const auto run = [&] {
    std::fesetenv(FE_DFL_ENV);
    return work();
  };
  return std::async(std::launch::async, run).get();
}

}  // namespace dpr
