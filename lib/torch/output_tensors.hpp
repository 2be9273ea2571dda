// The outputs beside the image as tensors.
#pragma once

#include <ATen/core/Tensor.h>

#include <vector>

#include "dpr/aov.hpp"

namespace dpr::torch_op {

/// An auxiliary output of every view (at least one), a copy: [view, height, width], with 3 channels of
/// normals and barycentrics, 2 of texture coordinates; float32, int64 for the faces. Throws InvalidArgument
/// for texture coordinates of meshes without.
at::Tensor stack_outputs(const std::vector<AuxiliaryOutputs>& views, Aov aov);

}  // namespace dpr::torch_op
