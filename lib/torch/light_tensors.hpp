// Lights as the operator's users give them, tensors by kind, and as its numbers.
#pragma once

#include "dpr/light.hpp"
#include "torch/render.hpp"

namespace dpr::torch_op {

/// Lights whose numbers are yet to come, and a tensor of these, in their order.
struct PackedLights {
  Lights lights;
  at::Tensor numbers;
};

/// By torch's own operations, which differentiate the packing. What is not given is the model's. Throws
/// InvalidArgument for kinds that there are not, and tensors of other shapes.
PackedLights pack(const LightTensors& given, const Lights& model);

/// The lights with their numbers.
Lights unpack(Lights lights, const at::Tensor& numbers);

}  // namespace dpr::torch_op
