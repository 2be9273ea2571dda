// For embedding: the only header with OpenCL types. Needs the OpenCL C++ bindings (CL/opencl.hpp).
#pragma once

#include <CL/opencl.hpp>
#include <cstddef>

#include "dpr/device.hpp"
#include "dpr/renderer.hpp"

namespace dpr {

/// Uses the caller's context and in-order queue instead of making its own. The objects are retained. Throws
/// InvalidArgument for an out-of-order queue and for a queue of another context.
Device adopt_device(const cl::Context& context, const cl::CommandQueue& queue);

/// The rendered images, float4 RGBA [view][height][width], as forward() leaves them on the device. Valid
/// until the next forward() that needs a larger buffer. Work enqueued on the device's queue after forward()
/// sees the finished image.
cl::Buffer image_buffer(const Renderer& renderer);

/// Runs the backward pass from a buffer of d loss / d image, float4 RGBA [view][height][width], on the
/// device's context. Throws InvalidArgument for a buffer of another context.
SceneGradient backward(Renderer& renderer, const cl::Buffer& grad_images);

}  // namespace dpr
