// What surfaces show in place of their colours, as tensors with gradients.
#pragma once

#include <ATen/core/Tensor.h>

#include "dpr/attribute_images.hpp"
#include "torch/batch.hpp"
#include "torch/renderer_pool.hpp"

namespace dpr::torch_op {

/// Of a rendered frame, [view, height, width, 4]: RGB and the sum of weights A, as AttributeImages has them.
/// `wanted`: what backward_attribute() may be asked for. Throws the library's errors.
at::Tensor render_attribute(Frame& frame, Attribute attribute, const Wanted& wanted);

/// From the gradient of these images, of vertices, views (rigid motions), intrinsics, smoothing, and for
/// Attribute::texcoords of these; of whatever else is wanted there is none.
Gradients backward_attribute(Frame& frame, Attribute attribute, const at::Tensor& grad_images,
                             const at::Tensor& vertices, const at::Tensor& views, const Wanted& wanted);

}  // namespace dpr::torch_op
