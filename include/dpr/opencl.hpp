// Embedding with the OpenCL C++ bindings, of any version and with any CL_HPP_ setting of the caller's.
#pragma once

#include <CL/opencl.hpp>

#include "dpr/opencl_handles.hpp"

namespace dpr {

/// The calls of dpr/opencl_handles.hpp with the bindings' types.
inline Device adopt_device(const cl::Context& context, const cl::CommandQueue& queue) {
  return adopt_device(context(), queue());
}

/// Vectors in the caller's buffer; offset and stride in bytes, 0 for packed ones.
inline BufferSpan span_of(const cl::Buffer& buffer, std::size_t offset = 0, std::size_t stride = 0) {
  return {buffer(), offset, stride};
}

/// A buffer of the library's, retained: it outlives the renderer's own use of it. Gradients share buffers, so
/// that a kernel needs the offset too.
struct BufferAt {
  cl::Buffer buffer;
  std::size_t offset = 0;  ///< bytes before the view's first vector
};
inline BufferAt buffer_of(const BufferView& view) { return {cl::Buffer(view.buffer, true), view.offset}; }

/// Retained: outlives the renderer's own use of it.
inline cl::Buffer image_buffer(const Renderer& renderer) { return cl::Buffer(image_handle(renderer), true); }

inline SceneGradient backward(Renderer& renderer, const cl::Buffer& grad_images) {
  return backward(renderer, grad_images());
}

}  // namespace dpr
