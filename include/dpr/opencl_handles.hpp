// For embedding by OpenCL's C handles. dpr/opencl.hpp does the same with the C++ bindings.
#pragma once

#include <CL/cl.h>

#include "dpr/device.hpp"
#include "dpr/export.h"
#include "dpr/renderer.hpp"

namespace dpr {

/// Uses the caller's context and in-order queue instead of making its own. Both are retained. Throws
/// InvalidArgument for an out-of-order queue and for a queue of another context, DeviceError for what is no
/// queue.
DPR_API Device adopt_device(cl_context context, cl_command_queue queue);

/// The rendered images, float4 RGBA [view][height][width], as forward() leaves them on the device. Not
/// retained: valid until the next forward() that needs a larger buffer. Work enqueued on the device's queue
/// after forward() sees the finished image. Throws InvalidArgument where there is no image.
DPR_API cl_mem image_handle(const Renderer& renderer);

/// Runs the backward pass from a buffer of d loss / d image, float4 RGBA [view][height][width], on the
/// device's context. Throws InvalidArgument for a buffer of another context, or one that is too small.
DPR_API SceneGradient backward(Renderer& renderer, cl_mem grad_images);

}  // namespace dpr
