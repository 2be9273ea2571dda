// The OpenCL C++ bindings for the library itself, as dpr::cl. They are compiled under a name of their own: a
// program that embeds the library may include them with other settings (CL_HPP_ENABLE_EXCEPTIONS, another
// version), and of two inline functions of one name the linker keeps one.
#pragma once

#ifdef CL_HPP_
#error "device/opencl_bindings.hpp comes before CL/opencl.hpp"
#endif

#define CL_HPP_TARGET_OPENCL_VERSION 120
#define CL_HPP_MINIMUM_OPENCL_VERSION 120
#define cl dpr_cl
#include <CL/opencl.hpp>
#undef cl

namespace dpr {
namespace cl = ::dpr_cl;
}  // namespace dpr
