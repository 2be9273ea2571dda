// Indices that are given as tensors.
#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <string>
#include <vector>

#include "torch/surface.hpp"

namespace dpr::torch_op {

/// Of a tensor int64 [face, 3] on the CPU. Throws InvalidArgument, which calls it `name`.
Faces read_faces(const at::Tensor& faces, const std::string& name);

/// Of a tensor int64 [face] on the CPU, numbers from `least` on: 0, or -1 for none, which becomes
/// k_no_texture. Throws as read_faces().
std::vector<std::uint32_t> read_of_faces(const at::Tensor& indices, const std::string& name,
                                         std::int64_t least);

}  // namespace dpr::torch_op
