#include "torch/light_tensors.hpp"

#include <ATen/Functions.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "base/name_list.hpp"
#include "torch/errors.hpp"

namespace dpr::torch_op {
namespace {

/// Of the tensor of a key, if all views have the same.
std::int64_t shared_dimensions(const std::string& key) { return key == "ambient" ? 1 : 2; }

void require_known(const LightTensors& given) {
  std::vector<std::string_view> keys{"ambient", "harmonics"};
  for_each_light_kind([&](auto kind) { keys.push_back(kind.key); });
  for (const auto& entry : given) {
    if (std::ranges::find(keys, entry.key()) == keys.end())
      throw InvalidArgument("lights (dpr::render_lit)", "\"" + entry.key() + "\"", one_of(keys));
  }
}

/// Throws InvalidArgument unless these are the counts of coefficients of harmonics and of each kind's lights
/// that have these numbers.
void require_counts(const at::Tensor& numbers, at::IntArrayRef counts) {
  constexpr std::int64_t k_of_color = 3;
  std::vector<std::int64_t> sizes{k_of_color};
  for_each_light_kind([&](auto kind) { sizes.push_back(count_numbers(kind)); });
  if (counts.size() != sizes.size()) {
    throw InvalidArgument("light_counts (dpr::_render)", std::to_string(counts.size()) + " counts",
                          "none, or " + std::to_string(sizes.size()) + ", of harmonics and each kind");
  }
  std::int64_t expected = k_of_color;  // ambient light
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    if (counts[i] < 0 || counts[i] > numbers.numel()) {
      throw InvalidArgument("light_counts (dpr::_render)", std::to_string(counts[i]),
                            "0 or more, of lights whose numbers are given");
    }
    expected += counts[i] * sizes[i];
  }
  if (numbers.numel() != expected) {
    throw InvalidArgument("lights (dpr::_render)", std::to_string(numbers.numel()) + " numbers",
                          std::to_string(expected) + ", by light_counts");
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

bool is_of_views(const LightTensors& given) {
  for (const auto& entry : given) {
    if (entry.value().dim() == shared_dimensions(entry.key()) + 1) return true;
  }
  return false;
}

LightTensors of_view(const LightTensors& given, const ViewOfBatch& view) {
  LightTensors lights;
  for (const auto& entry : given) {
    const std::string& key = entry.key();
    lights.insert(key, of_view(entry.value(), shared_dimensions(key), view, "lights." + key));
  }
  return lights;
}

Lights unpack(Lights lights, const at::Tensor& numbers) {
  const float* next = numbers.data_ptr<float>();
  for_each_light_number(lights, [&](std::string_view, float& number) { number = *next++; });
  return lights;
}

std::optional<Lights> unpack_counted(const at::Tensor& tensor, at::IntArrayRef counts, Lights lights) {
  if (counts.empty()) return {};
  const at::Tensor numbers = checked(tensor, "lights", {-1}, "[number]");
  require_counts(numbers, counts);
  const auto* count = counts.begin();
  lights.harmonics.resize(static_cast<std::size_t>(*count++));
  for_each_light_kind([&](auto kind) { (lights.*kind.lights).resize(static_cast<std::size_t>(*count++)); });
  return unpack(std::move(lights), numbers);
}

}  // namespace dpr::torch_op
