// A frame in a graph: a tensor of one byte that owns it.
#pragma once

#include <ATen/core/Tensor.h>

#include <memory>

#include "torch/renderer_pool.hpp"

namespace dpr::torch_op {

at::Tensor tensor_of(std::unique_ptr<Frame> frame);

/// What the tensor owns, for as long as there is a copy of it. Throws InvalidArgument for another tensor.
Frame& frame_of(const at::Tensor& tensor);

}  // namespace dpr::torch_op
