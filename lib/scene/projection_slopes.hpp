// How a camera's own parameters change its projection: for gradients and tangents.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/trigonometric.hpp>

#include "dpr/camera.hpp"

namespace dpr {

/// The derivatives of both scales by the parameter that the camera has, and of scale x, y and offset x, y by
/// fx, fy, cx, cy; those of parameters that it has not are 0.
struct ProjectionSlopes {
  double by_orthographic_height = 0, by_fov_y_degrees = 0;
  std::array<double, 4> by_intrinsics{};
};

inline ProjectionSlopes projection_slopes(const Camera& camera, int width, int height) {
  const double short_side = std::min(width, height);
  ProjectionSlopes slopes;
  if (camera.orthographic_height) {
    const double extent = *camera.orthographic_height;
    slopes.by_orthographic_height = -2.0 * height / short_side / (extent * extent);
  } else if (camera.intrinsics) {
    const double factor = 2.0 / short_side;
    slopes.by_intrinsics = {factor, factor, factor, -factor};
  } else {
    const double half_angle = glm::radians(static_cast<double>(camera.fov_y_degrees)) / 2;
    const double by_half_angle = -height / short_side / std::pow(std::sin(half_angle), 2);
    slopes.by_fov_y_degrees = by_half_angle * glm::radians(0.5);
  }
  return slopes;
}

}  // namespace dpr
