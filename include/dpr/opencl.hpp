// For embedding with the OpenCL C++ bindings, of any version and with any CL_HPP_ setting of the caller's.
#pragma once

#include <CL/opencl.hpp>

#include "dpr/opencl_handles.hpp"

namespace dpr {

/// adopt_device(), image_handle() and backward() of dpr/opencl_handles.hpp with the bindings' types.
inline Device adopt_device(const cl::Context& context, const cl::CommandQueue& queue) {
  return adopt_device(context(), queue());
}

/// Retained: outlives the renderer's own use of it.
inline cl::Buffer image_buffer(const Renderer& renderer) { return cl::Buffer(image_handle(renderer), true); }

inline SceneGradient backward(Renderer& renderer, const cl::Buffer& grad_images) {
  return backward(renderer, grad_images());
}

}  // namespace dpr
