// The memory of tensors as the library's vectors.
#pragma once

#include <ATen/core/Tensor.h>

#include <cstddef>
#include <span>

namespace dpr::torch_op {

/// The memory of a contiguous float32 tensor whose rows are vectors.
template <typename Vector>
std::span<const Vector> rows(const at::Tensor& tensor) {
  static_assert(sizeof(Vector) == Vector::length() * sizeof(float));
  return {reinterpret_cast<const Vector*>(tensor.data_ptr<float>()),
          static_cast<std::size_t>(tensor.numel() / Vector::length())};
}

}  // namespace dpr::torch_op
