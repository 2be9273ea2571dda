#include "renderer/finite.hpp"

#include <cmath>
#include <string>

#include "base/checks.hpp"
#include "scene/gradient_table.hpp"

namespace dpr {
namespace {

[[noreturn]] void fail(const std::string& name, double value) {
  throw InvalidArgument("gradient of " + name + " (backward)", checks::text(value),
                        "a finite number; the scene's lengths or the smoothing are beyond single precision");
}

}  // namespace

void require_scales(const Camera& camera, const Smoothing& smoothing, bool lit) {
  constexpr float k_largest = 1e36F, k_largest_length = 1e9F;
  const float range = camera.zfar - camera.znear;
  if (!(range <= k_largest && 1 / range <= k_largest)) {
    throw InvalidArgument("zfar - znear (camera)", checks::text(range),
                          "a length from 1e-36 to 1e36, whose inverse single precision holds");
  }
  if (!(1 / range / smoothing.gamma <= k_largest)) {
    throw InvalidArgument(
        "gamma (smoothing)", checks::text(smoothing.gamma),
        "at least " + checks::text(1 / range / k_largest) +
            " with these clipping planes: single precision holds 1 / (gamma (zfar - znear))");
  }
  if (lit && (camera.znear > k_largest_length || camera.zfar < 1 / k_largest_length)) {
    throw InvalidArgument(
        "znear to zfar (camera)",
        checks::text(camera.znear) + " to " + checks::text(camera.zfar) + " with lights",
        "lengths from 1e-9 to 1e9, whose powers single precision holds: another unit of length");
  }
}

void require_finite(SceneGradient& gradient) {
  for_each_array(gradient, [](const GradientRow& row, GradientIndex index, const GradientArray& array) {
    std::size_t count = 0;
    transform_numbers(array, [&](double value) {
      if (!std::isfinite(value)) {
        const std::string name = name_of(row, index);
        const std::size_t components = std::holds_alternative<std::vector<glm::vec3>*>(array)   ? 3
                                       : std::holds_alternative<std::vector<glm::vec2>*>(array) ? 2
                                                                                                : 0;
        fail(components > 0 ? checks::element(name, count / components) : name, value);
      }
      ++count;
      return value;
    });
  });
}

}  // namespace dpr
