#include "torch/light_tensors.hpp"

#include <ATen/Functions.h>

#include <algorithm>
#include <string>
#include <vector>

#include "base/name_list.hpp"
#include "torch/errors.hpp"

namespace dpr::torch_op {
namespace {

void require_known(const LightTensors& given) {
  std::vector<std::string_view> keys{"ambient", "harmonics"};
  for_each_light_kind([&](auto kind) { keys.push_back(kind.key); });
  for (const auto& entry : given) {
    if (std::ranges::find(keys, entry.key()) == keys.end())
      throw InvalidArgument("lights (dpr::render_lit)", "\"" + entry.key() + "\"", one_of(keys));
  }
}

}  // namespace

PackedLights pack(const LightTensors& given, const Lights& model) {
  require_known(given);
  PackedLights packed{model, {}};
  std::vector<at::Tensor> parts;
  const auto take = [&](std::string_view key, std::initializer_list<std::int64_t> shape,
                        const std::string& expected) {
    const std::string name(key);
    if (!given.contains(name)) return std::int64_t{0};
    const at::Tensor tensor = given.at(name);
    parts.push_back(checked(tensor, "lights." + name, shape, expected.c_str()).flatten());
    return tensor.size(0);
  };
  if (take("ambient", {3}, "[3]") == 0) {
    const glm::vec3& ambient = model.ambient;
    parts.push_back(at::tensor({ambient.x, ambient.y, ambient.z}, at::kFloat));
  }
  packed.lights.harmonics.resize(
      static_cast<std::size_t>(take("harmonics", {static_cast<std::int64_t>(k_harmonics), 3}, "[9, 3]")));
  for_each_light_kind([&](auto kind) {
    const std::int64_t count = count_numbers(kind);
    (packed.lights.*kind.lights)
        .resize(
            static_cast<std::size_t>(take(kind.key, {-1, count}, "[light, " + std::to_string(count) + "]")));
  });
  packed.numbers = at::cat(parts);
  return packed;
}

Lights unpack(Lights lights, const at::Tensor& numbers) {
  const float* next = numbers.data_ptr<float>();
  for_each_light_number(lights, [&](std::string_view, float& number) { number = *next++; });
  return lights;
}

}  // namespace dpr::torch_op
