// Every kind of light once: its key in files, its members with their gradients, what the device sees of it.
// Files, checks, uploads, gradients, frames of arrays and tests walk this table.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dpr/renderer.hpp"
#include "shared_types.h"

namespace dpr {

/// Names in files, in the order of the enumeration.
inline constexpr std::array<std::string_view, 5> k_shadings{"flat", "phong", "gouraud", "blinn",
                                                            "microfacet"};

/// A kind has
/// - key, lights, gradients: its list in files, in Lights and in SceneGradient
/// - needs: bits of DPR_LIGHTS that its kernels are built with
/// - for_each_member(visit): visit(key, member, member of the gradient, channel, slope) in the order of
///   files, slope(light) being the derivative of what the channel has the gradient of
/// - to_device(light)
template <typename Light>
struct LightKind;

template <typename Light>
constexpr double no_slope(const Light&) {
  return 1;
}

template <>
struct LightKind<PointLight> {
  using Light = PointLight;
  using Gradient = PointLightGradient;
  static constexpr std::string_view key = "point";
  static constexpr auto lights = &Lights::point;
  static constexpr auto gradients = &SceneGradient::lights;
  static constexpr cl_uint needs = 0;

  template <typename Visit>
  static void for_each_member(Visit&& visit) {
    visit("position", &Light::position, &Gradient::position, DPR_CHANNEL_POSITION, no_slope<Light>);
    visit("diffuse", &Light::diffuse, &Gradient::diffuse, DPR_CHANNEL_DIFFUSE, no_slope<Light>);
    visit("specular", &Light::specular, &Gradient::specular, DPR_CHANNEL_SPECULAR, no_slope<Light>);
  }
  static shared::Light to_device(const Light& light);
};

template <>
struct LightKind<DirectionalLight> {
  using Light = DirectionalLight;
  using Gradient = DirectionalLightGradient;
  static constexpr std::string_view key = "directional";
  static constexpr auto lights = &Lights::directional;
  static constexpr auto gradients = &SceneGradient::directional;
  static constexpr cl_uint needs = DPR_LIGHTS_DISTANT;

  template <typename Visit>
  static void for_each_member(Visit&& visit) {
    visit("direction", &Light::direction, &Gradient::direction, DPR_CHANNEL_POSITION,
          [](const Light&) { return -1.0; });
    visit("diffuse", &Light::diffuse, &Gradient::diffuse, DPR_CHANNEL_DIFFUSE, no_slope<Light>);
    visit("specular", &Light::specular, &Gradient::specular, DPR_CHANNEL_SPECULAR, no_slope<Light>);
  }
  static shared::Light to_device(const Light& light);
};

template <>
struct LightKind<SpotLight> {
  using Light = SpotLight;
  using Gradient = SpotLightGradient;
  static constexpr std::string_view key = "spot";
  static constexpr auto lights = &Lights::spot;
  static constexpr auto gradients = &SceneGradient::spot;
  static constexpr cl_uint needs = DPR_LIGHTS_CONES;

  template <typename Visit>
  static void for_each_member(Visit&& visit) {
    visit("position", &Light::position, &Gradient::position, DPR_CHANNEL_POSITION, no_slope<Light>);
    visit("direction", &Light::direction, &Gradient::direction, DPR_CHANNEL_AXIS, no_slope<Light>);
    visit("angle_degrees", &Light::angle_degrees, &Gradient::angle_degrees, DPR_CHANNEL_COS_OUTER,
          [](const Light& light) { return cosine_slope(light.angle_degrees); });
    visit("inner_angle_degrees", &Light::inner_angle_degrees, &Gradient::inner_angle_degrees,
          DPR_CHANNEL_COS_INNER, [](const Light& light) { return cosine_slope(light.inner_angle_degrees); });
    visit("diffuse", &Light::diffuse, &Gradient::diffuse, DPR_CHANNEL_DIFFUSE, no_slope<Light>);
    visit("specular", &Light::specular, &Gradient::specular, DPR_CHANNEL_SPECULAR, no_slope<Light>);
  }
  static shared::Light to_device(const Light& light);
  static double cosine_slope(float degrees);
};

/// visit(kind) for every kind, in the order in which the device has the lights.
template <typename Visit>
void for_each_light_kind(Visit&& visit) {
  visit(LightKind<PointLight>());
  visit(LightKind<DirectionalLight>());
  visit(LightKind<SpotLight>());
}

/// visit(key, number) for a number, or for those of a vector.
template <typename Value, typename Visit>
void visit_numbers(std::string_view key, Value& value, const Visit& visit) {
  if constexpr (requires { value.x; }) {
    for (int axis = 0; axis < 3; ++axis) visit(key, value[axis]);
  } else {
    visit(key, value);
  }
}

/// visit(key, number) for every number of the lights that has a gradient, ambient light, harmonics,
/// then light by light.
template <typename Visit>
void for_each_light_number(Lights& lights, const Visit& visit) {
  visit_numbers("ambient", lights.ambient, visit);
  for (glm::vec3& c : lights.harmonics) visit_numbers("harmonics", c, visit);
  for_each_light_kind([&](auto kind) {
    for (auto& light : lights.*kind.lights) {
      kind.for_each_member(
          [&](std::string_view key, auto member, auto...) { visit_numbers(key, light.*member, visit); });
    }
  });
}

/// The same for their gradients.
template <typename Visit>
void for_each_light_number(SceneGradient& gradient, const Visit& visit) {
  visit_numbers("ambient", gradient.ambient, visit);
  for (glm::vec3& c : gradient.harmonics) visit_numbers("harmonics", c, visit);
  for_each_light_kind([&](auto kind) {
    for (auto& light : gradient.*kind.gradients) {
      kind.for_each_member([&](std::string_view key, auto, auto member, auto...) {
        visit_numbers(key, light.*member, visit);
      });
    }
  });
}

/// "lights.point"
template <typename Kind>
std::string list_of(Kind) {
  return "lights." + std::string(Kind::key);
}

/// By its name in files. Throws InvalidArgument for another word, which it calls `argument`.
Shading parse_shading(const std::string& word, const std::string& argument);

/// One for all views, or none.
inline std::span<const Lights> span_of(const std::optional<Lights>& lights) {
  return lights ? std::span(&*lights, 1) : std::span<const Lights>();
}

/// The bits of DPR_LIGHTS.
cl_uint needs_of(const Lights& lights);
/// A view's rows in the list of lights: the environment, then the lights.
std::vector<shared::Light> device_lights(const Lights& lights);
/// From the sums of the channels: of the environment, then of every light.
void read_light_gradients(const Lights& lights, std::span<const float> sums, SceneGradient& gradient);

}  // namespace dpr
