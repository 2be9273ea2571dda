#include "torch/output_tensors.hpp"

#include <ATen/Functions.h>

#include <cstdint>
#include <type_traits>

#include "dpr/error.hpp"

namespace dpr::torch_op {

at::Tensor stack_outputs(const std::vector<AuxiliaryOutputs>& views, Aov aov) {
  const auto copy = [&](const auto& list, at::IntArrayRef channels) {
    std::vector<std::int64_t> shape{views.front().height, views.front().width};
    shape.insert(shape.end(), channels.begin(), channels.end());
    using Value = typename std::decay_t<decltype(views.front().*list)>::value_type;
    const auto type = std::is_same_v<Value, std::int32_t> ? at::kInt : at::kFloat;
    std::vector<at::Tensor> tensors;
    for (const AuxiliaryOutputs& view : views) {
      // from_blob() takes no constant memory; the copy reads it alone.
      tensors.push_back(at::from_blob(const_cast<Value*>((view.*list).data()), shape, type));
    }
    return at::stack(tensors);
  };
  switch (aov) {
    case Aov::depth:
      return copy(&AuxiliaryOutputs::depth, {});
    case Aov::normal:
      return copy(&AuxiliaryOutputs::normal, {3});
    case Aov::face_id:
      return copy(&AuxiliaryOutputs::face_id, {}).to(at::kLong);
    case Aov::barycentrics:
      return copy(&AuxiliaryOutputs::barycentrics, {3});
    case Aov::effective_faces:
      return copy(&AuxiliaryOutputs::effective_faces, {});
    case Aov::uv:
      break;
  }
  if (views.front().uv.empty())
    throw InvalidArgument("outputs (dpr.render)", "uv", "an output of meshes without texture coordinates");
  return copy(&AuxiliaryOutputs::uv, {2});
}

}  // namespace dpr::torch_op
