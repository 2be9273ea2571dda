// Tensors that views may have in common or each their own.
#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <string>

#include "torch/errors.hpp"

namespace dpr::torch_op {

struct ViewOfBatch {
  std::int64_t index, count;
};

/// A view's part of a tensor with one dimension more than `shared`, the leading one of views; any other
/// tensor as it is. Throws InvalidArgument, which calls it `name`, for a leading dimension of another size.
inline at::Tensor of_view(const at::Tensor& tensor, std::int64_t shared, const ViewOfBatch& view,
                          const std::string& name) {
  if (tensor.dim() != shared + 1) return tensor;
  if (tensor.size(0) != view.count) {
    throw InvalidArgument(name + " (dpr::render)", shape_text(tensor),
                          std::to_string(view.count) + ", one a view, in the first dimension");
  }
  return tensor.select(0, view.index);
}

}  // namespace dpr::torch_op
