// What OpenCL objects say of themselves.
#pragma once

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

}  // namespace dpr
