// The pinhole camera: its projection, its checks, and its views in the axes of other programs.
#include "dpr/camera.hpp"

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "base/checks.hpp"

namespace dpr {
namespace {

// The rows of a view in other camera axes: both are their own inverses.
const glm::mat4 k_opengl_to_opencv(glm::vec4(1, 0, 0, 0), glm::vec4(0, -1, 0, 0), glm::vec4(0, 0, -1, 0),
                                   glm::vec4(0, 0, 0, 1));
const glm::mat4 k_opengl_to_pytorch3d(glm::vec4(-1, 0, 0, 0), glm::vec4(0, 1, 0, 0), glm::vec4(0, 0, -1, 0),
                                      glm::vec4(0, 0, 0, 1));

}  // namespace

Projection projection(const Camera& camera, int width, int height) {
  const double short_side = std::min(width, height);
  if (!camera.intrinsics) {
    // The field of view spans the height; pixels are square; NDC counts in halves of the short side.
    const double half_angle = 0.5 * glm::radians(static_cast<double>(camera.fov_y_degrees));
    const auto scale = static_cast<float>(height / (short_side * std::tan(half_angle)));
    return {glm::vec2(scale), glm::vec2(0)};
  }
  // Column u = fx x / d + cx and row v = cy - fy y / d, both from the top-left corner; NDC from the centre, y
  // up.
  const Intrinsics& k = *camera.intrinsics;
  const double ndc_per_pixel = 2.0 / short_side;
  return {glm::vec2(ndc_per_pixel * k.fx, ndc_per_pixel * k.fy),
          glm::vec2(ndc_per_pixel * (k.cx - 0.5 * width), ndc_per_pixel * (0.5 * height - k.cy))};
}

void validate(const Camera& camera, const std::string& name) {
  checks::require_affine(camera.view, checks::in("view", name));
  if (camera.intrinsics) {
    checks::require_positive(camera.intrinsics->fx, checks::in("fx", name + ".intrinsics"));
    checks::require_positive(camera.intrinsics->fy, checks::in("fy", name + ".intrinsics"));
    checks::require_finite(camera.intrinsics->cx, checks::in("cx", name + ".intrinsics"));
    checks::require_finite(camera.intrinsics->cy, checks::in("cy", name + ".intrinsics"));
  } else if (!(camera.fov_y_degrees > 0 && camera.fov_y_degrees < 180)) {
    throw InvalidArgument(checks::in("fov_y_degrees", name), checks::text(camera.fov_y_degrees),
                          "an angle between 0 and 180, both excluded");
  }
  checks::require_positive(camera.znear, checks::in("znear", name));
  if (!(camera.zfar > camera.znear && std::isfinite(camera.zfar))) {
    throw InvalidArgument(checks::in("zfar", name), checks::text(camera.zfar),
                          "a finite number above znear, " + checks::text(camera.znear));
  }
}

Camera orbit_camera(float distance, float elevation_degrees, float azimuth_degrees, glm::vec3 target) {
  checks::require_positive(distance, "distance (orbit_camera)");
  if (!(elevation_degrees > -90 && elevation_degrees < 90)) {
    throw InvalidArgument("elevation_degrees (orbit_camera)", checks::text(elevation_degrees),
                          "an angle between -90 and 90, both excluded");
  }
  checks::require_finite(azimuth_degrees, "azimuth_degrees (orbit_camera)");
  checks::require_finite(target, "target (orbit_camera)");
  const double elevation = glm::radians(static_cast<double>(elevation_degrees));
  const double azimuth = glm::radians(static_cast<double>(azimuth_degrees));
  const glm::dvec3 direction(std::cos(elevation) * std::sin(azimuth), std::sin(elevation),
                             std::cos(elevation) * std::cos(azimuth));
  const glm::dvec3 centre(target);
  Camera camera;
  camera.view = glm::mat4(
      glm::lookAtRH(centre + static_cast<double>(distance) * direction, centre, glm::dvec3(0.0, 1.0, 0.0)));
  return camera;
}

glm::mat4 to_opencv_view(const glm::mat4& view) { return k_opengl_to_opencv * view; }

glm::mat4 from_opencv_view(const glm::mat4& view) { return k_opengl_to_opencv * view; }

PyTorch3dView to_pytorch3d_view(const glm::mat4& view) {
  const glm::mat4 turned = k_opengl_to_pytorch3d * view;
  return {glm::transpose(glm::mat3(turned)),
          glm::vec3(turned[3])};  // row vectors: the linear part is transposed
}

glm::mat4 from_pytorch3d_view(const PyTorch3dView& view) {
  glm::mat4 turned(glm::transpose(view.R));
  turned[3] = glm::vec4(view.T, 1);
  return k_opengl_to_pytorch3d * turned;
}

}  // namespace dpr
