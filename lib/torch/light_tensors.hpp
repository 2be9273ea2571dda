// Lights as the operator's users give them, tensors by kind, and as its numbers.
#pragma once

#include <c10/util/ArrayRef.h>

#include <cstdint>
#include <optional>

#include "dpr/light.hpp"
#include "scene/light_table.hpp"
#include "torch/render.hpp"
#include "torch/view_tensors.hpp"

namespace dpr::torch_op {

/// How many numbers a light of a kind has (scene/light_table.hpp).
template <typename Kind>
std::int64_t count_numbers(Kind) {
  std::int64_t count = 0;
  typename Kind::Light light;
  Kind::for_each_member([&](std::string_view key, auto member, auto...) {
    visit_numbers(key, light.*member, [&](std::string_view, float) { ++count; });
  });
  return count;
}

/// Lights whose numbers are yet to come, and a tensor of these, in their order.
struct PackedLights {
  Lights lights;
  at::Tensor numbers;
};

/// By torch's own operations, which differentiate the packing. What is not given is the model's. Throws
/// InvalidArgument for kinds that there are not, and tensors of other shapes.
PackedLights pack(const LightTensors& given, const Lights& model);

/// Whether lights have a leading dimension of views.
bool is_of_views(const LightTensors& given);
/// What a view has of them. Throws InvalidArgument for leading dimensions of another size.
LightTensors of_view(const LightTensors& given, const ViewOfBatch& view);

/// The lights with their numbers, which are as many as the lights have.
Lights unpack(Lights lights, const at::Tensor& numbers);

/// Lights of a tensor's numbers, and of as many coefficients of harmonics and lights of each kind; none if
/// nothing is counted. What has no numbers stays as it is in `lights`. Throws InvalidArgument unless the
/// counts fit the numbers.
std::optional<Lights> unpack_counted(const at::Tensor& tensor, at::IntArrayRef counts, Lights lights);

}  // namespace dpr::torch_op
