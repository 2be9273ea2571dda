#include "torch/index_tensors.hpp"

#include <limits>

#include "torch/errors.hpp"

namespace dpr::torch_op {
namespace {

/// All of them, in the tensor's order; -1 becomes the largest number there is.
std::vector<std::uint32_t> checked_indices(const at::Tensor& tensor, const std::string& name,
                                           std::int64_t least) {
  const at::Tensor values = tensor.contiguous();
  const auto* const index = values.data_ptr<std::int64_t>();
  std::vector<std::uint32_t> result(static_cast<std::size_t>(values.numel()));
  for (std::size_t i = 0; i < result.size(); ++i) {
    if (index[i] < least || index[i] >= std::numeric_limits<std::uint32_t>::max())
      throw InvalidArgument(name, std::to_string(index[i]), "indices from " + std::to_string(least) + " on");
    result[i] = static_cast<std::uint32_t>(index[i]);
  }
  return result;
}

[[noreturn]] void fail_tensor(const at::Tensor& tensor, const std::string& name, const char* shape) {
  throw InvalidArgument(name, tensor.toString() + " " + shape_text(tensor),
                        std::string("an int64 tensor ") + shape + " on the CPU");
}

bool holds_indices(const at::Tensor& tensor, std::int64_t dimensions) {
  return tensor.scalar_type() == at::kLong && tensor.device().is_cpu() && tensor.dim() == dimensions;
}

}  // namespace

Faces read_faces(const at::Tensor& faces, const std::string& name) {
  if (!holds_indices(faces, 2) || faces.size(1) != 3) fail_tensor(faces, name, "[face, 3]");
  const std::vector<std::uint32_t> corners = checked_indices(faces, name, 0);
  Faces result;
  for (std::size_t i = 0; i < corners.size(); i += 3)
    result.emplace_back(corners[i], corners[i + 1], corners[i + 2]);
  return result;
}

std::vector<std::uint32_t> read_of_faces(const at::Tensor& indices, const std::string& name,
                                         std::int64_t least) {
  if (!holds_indices(indices, 1)) fail_tensor(indices, name, "[face]");
  return checked_indices(indices, name, least);
}

}  // namespace dpr::torch_op
