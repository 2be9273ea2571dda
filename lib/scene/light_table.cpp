#include "scene/light_table.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "base/name_list.hpp"
#include "dpr/error.hpp"

namespace dpr {
namespace {

cl_float4 to_cl(const glm::dvec3& v, double w = 0) {
  return {{static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z), static_cast<float>(w)}};
}

double cosine(float degrees) { return std::cos(glm::radians(static_cast<double>(degrees))); }

/// Constants of the basis, times the reflectance of a white diffuse surface in each order: 1, 2/3 and 1/4.
std::array<double, k_harmonics> harmonic_constants() {
  const auto root = [](double over_pi) { return std::sqrt(over_pi / std::numbers::pi); };
  const double first = 2.0 / 3 * root(0.75), second = 0.25 * root(3.75);
  return {root(0.25), first, first, first, second, second, second / std::sqrt(12.0), second, second / 2};
}

glm::dvec3 vector_at(std::span<const float> sums, std::size_t channel) {
  return {sums[channel], sums[channel + 1], sums[channel + 2]};
}

void read_channel(std::span<const float> sums, std::size_t channel, double slope, glm::dvec3& value) {
  value = slope * vector_at(sums, channel);
}

void read_channel(std::span<const float> sums, std::size_t channel, double slope, double& value) {
  value = slope * static_cast<double>(sums[channel]);
}

/// A light that shines whatever way: no direction to it is beyond this cone.
shared::Light in_all_directions(const glm::dvec3& position, double w, const glm::vec3& diffuse,
                                const glm::vec3& specular) {
  return {to_cl(position, w), to_cl(diffuse), to_cl(specular), to_cl(glm::dvec3(0)), -2, 1, 0, 0};
}

}  // namespace

shared::Light LightKind<PointLight>::to_device(const Light& light) {
  return in_all_directions(light.position, 1, light.diffuse, light.specular);
}

shared::Light LightKind<DirectionalLight>::to_device(const Light& light) {
  return in_all_directions(-light.direction, 0, light.diffuse, light.specular);
}

shared::Light LightKind<SpotLight>::to_device(const Light& light) {
  const glm::dvec3 direction(light.direction);
  const double inverse = 1 / glm::length(direction), outer = cosine(light.angle_degrees);
  shared::Light result = in_all_directions(light.position, 1, light.diffuse, light.specular);
  result.axis = to_cl(direction * inverse, inverse);
  result.cos_outer = static_cast<float>(outer);
  result.inverse_edge = static_cast<float>(1 / (cosine(light.inner_angle_degrees) - outer));
  return result;
}

/// By degrees.
double LightKind<SpotLight>::cosine_slope(float degrees) {
  return -std::sin(glm::radians(static_cast<double>(degrees))) * glm::radians(1.0);
}

Shading parse_shading(const std::string& word, const std::string& argument) {
  return static_cast<Shading>(position_of(word, k_shadings, argument));
}

cl_uint needs_of(const Lights& lights) {
  cl_uint needs = lights.harmonics.empty() ? 0 : DPR_LIGHTS_HARMONICS;
  for_each_light_kind([&](auto kind) {
    if (!(lights.*kind.lights).empty()) needs |= kind.needs;
  });
  return needs;
}

std::vector<shared::Light> device_lights(const Lights& lights) {
  shared::Environment environment{to_cl(lights.ambient), {}};
  const auto constants = harmonic_constants();
  for (std::size_t k = 0; k < lights.harmonics.size(); ++k)
    environment.harmonics[k] = to_cl(constants[k] * glm::dvec3(lights.harmonics[k]));
  const auto rows = std::bit_cast<std::array<shared::Light, DPR_ENVIRONMENT_ROWS>>(environment);
  std::vector<shared::Light> result(rows.begin(), rows.end());
  for_each_light_kind([&](auto kind) {
    for (const auto& light : lights.*kind.lights) result.push_back(kind.to_device(light));
  });
  return result;
}

void read_light_gradients(const Lights& lights, std::span<const float> sums, SceneGradient& gradient) {
  const cl_uint needs = needs_of(lights);
  const auto constants = harmonic_constants();
  gradient.ambient = vector_at(sums, 0);
  for (std::size_t k = 0; k < lights.harmonics.size(); ++k)
    gradient.harmonics.emplace_back(constants[k] * vector_at(sums, 3 + 3 * k));
  sums = sums.subspan(DPR_ENVIRONMENT_CHANNELS(needs));
  for_each_light_kind([&](auto kind) {
    for (const auto& light : lights.*kind.lights) {
      auto& grad = (gradient.*kind.gradients).emplace_back();
      kind.for_each_member([&](std::string_view, auto, auto member, std::size_t channel, auto slope) {
        read_channel(sums, channel, slope(light), grad.*member);
      });
      sums = sums.subspan(DPR_LIGHT_CHANNELS(needs));
    }
  });
}

}  // namespace dpr
