// Validity of lights.
#include "dpr/light.hpp"

#include "base/checks.hpp"
#include "base/name_list.hpp"
#include "scene/light_table.hpp"

namespace dpr {
namespace {

void require_direction(const glm::vec3& direction, const std::string& argument) {
  constexpr float k_shortest = 1e-9F, k_longest = 1e9F;  // whose squares single precision holds
  const float length = glm::length(direction);
  if (!(length >= k_shortest && length <= k_longest))
    throw InvalidArgument(argument, checks::text(direction), "a vector of length 1e-9 to 1e9");
}

/// Checks of each kind beyond finite numbers.
void check(const PointLight&, const std::string&) {}

void check(const DirectionalLight& light, const std::string& where) {
  require_direction(light.direction, checks::in("direction", where));
}

void check(const SpotLight& light, const std::string& where) {
  constexpr float k_narrowest = 0.1F;  // degrees; below, single precision does not see the edge
  require_direction(light.direction, checks::in("direction", where));
  if (!(light.angle_degrees >= k_narrowest && light.angle_degrees <= 180)) {
    throw InvalidArgument(checks::in("angle_degrees", where), checks::text(light.angle_degrees),
                          checks::text(k_narrowest) + " to 180, from the axis");
  }
  const float most = light.angle_degrees - k_narrowest;
  if (!(light.inner_angle_degrees >= 0 && light.inner_angle_degrees <= most)) {
    throw InvalidArgument(checks::in("inner_angle_degrees", where), checks::text(light.inner_angle_degrees),
                          "0 to " + checks::text(most) + ", below angle_degrees");
  }
}

}  // namespace

void validate(const Lights& lights) {
  checks::require_finite(lights.ambient, "ambient (lights)");
  for_each_light_kind([&](auto kind) {
    const auto& list = lights.*kind.lights;
    for (std::size_t i = 0; i < list.size(); ++i) {
      const std::string where = checks::element(list_of(kind), i);
      kind.for_each_member([&](std::string_view key, auto member, auto...) {
        checks::require_finite(list[i].*member, checks::in(std::string(key), where));
      });
      check(list[i], where);
    }
  });
  if (!lights.harmonics.empty() && lights.harmonics.size() != k_harmonics) {
    throw InvalidArgument("harmonics (lights)", std::to_string(lights.harmonics.size()) + " colours",
                          std::to_string(k_harmonics) + " or none");
  }
  for (std::size_t k = 0; k < lights.harmonics.size(); ++k)
    checks::require_finite(lights.harmonics[k], checks::element("lights.harmonics", k));
  if (!(lights.shininess >= 1 && std::isfinite(lights.shininess))) {
    throw InvalidArgument("shininess (lights)", checks::text(lights.shininess), "a finite number >= 1");
  }
  const auto shading = static_cast<std::size_t>(lights.shading);
  if (shading >= k_shadings.size())
    throw InvalidArgument("shading (lights)", std::to_string(shading), one_of(k_shadings));
}

}  // namespace dpr
