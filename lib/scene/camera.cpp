// Cameras: their projection, their checks, and those of other programs.
#include "dpr/camera.hpp"

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <string>
#include <utility>

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
  if (camera.orthographic_height)
    return {glm::vec2(static_cast<float>(2.0 * height / short_side / *camera.orthographic_height)),
            glm::vec2(0)};
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

namespace {

void validate(const Distortion& d, const std::string& name) {
  const std::pair<const char*, float> coefficients[] = {{"k1", d.k1}, {"k2", d.k2}, {"p1", d.p1},
                                                        {"p2", d.p2}, {"k3", d.k3}, {"k4", d.k4}};
  for (const auto& [key, value] : coefficients) checks::require_finite(value, checks::in(key, name));
  checks::require_enumerator(d.model, LensModel::fisheye, checks::in("model", name));
  const auto require_zero = [&](float value, const char* key, const char* of) {
    if (value != 0)
      throw InvalidArgument(checks::in(key, name), checks::text(value), std::string("0 of ") + of);
  };
  if (d.model == LensModel::fisheye) {
    require_zero(d.p1, "p1", "a fisheye");
    require_zero(d.p2, "p2", "a fisheye");
  } else {
    require_zero(d.k4, "k4", "Brown's model");
  }
}

}  // namespace

void validate(const Camera& camera, const std::string& name) {
  checks::require_affine(camera.view, checks::in("view", name));
  if (const auto& lens = camera.distortion)
    validate(*lens, name + (lens->model == LensModel::fisheye ? ".fisheye" : ".distortion"));
  if (camera.orthographic_height) {
    checks::require_positive(*camera.orthographic_height, checks::in("orthographic_height", name));
    if (camera.intrinsics || camera.distortion) {
      throw InvalidArgument(checks::in(camera.intrinsics ? "intrinsics" : "distortion", name),
                            "one beside orthographic_height", "a perspective camera, or none");
    }
  } else if (camera.intrinsics) {
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

Intrinsics to_opencv_intrinsics(const Intrinsics& k) { return {k.fx, k.fy, k.cx - 0.5F, k.cy - 0.5F}; }

Intrinsics from_opencv_intrinsics(const Intrinsics& k) { return {k.fx, k.fy, k.cx + 0.5F, k.cy + 0.5F}; }

PyTorch3dProjection to_pytorch3d_projection(const Camera& camera, int width, int height) {
  const Projection p = projection(camera, width, height);
  return {p.scale, {-p.offset.x, p.offset.y}};
}

Intrinsics from_pytorch3d_projection(const PyTorch3dProjection& projection, int width, int height) {
  const glm::vec2 size(width, height);
  const float pixels_per_ndc = 0.5F * std::min(size.x, size.y);
  const glm::vec2 focal = pixels_per_ndc * projection.focal_length;
  const glm::vec2 centre = 0.5F * size - pixels_per_ndc * projection.principal_point;
  return {focal.x, focal.y, centre.x, centre.y};
}

glm::mat4 to_opengl_projection(const Camera& camera, int width, int height) {
  const Projection p = projection(camera, width, height);
  // Clip space spans the whole image, NDC its short side.
  const glm::vec2 part = static_cast<float>(std::min(width, height)) / glm::vec2(width, height);
  const float range = camera.zfar - camera.znear, sum = camera.zfar + camera.znear;
  glm::mat4 m(0.0F);
  m[0][0] = p.scale.x * part.x;
  m[1][1] = p.scale.y * part.y;
  if (camera.orthographic_height) {
    m[2][2] = -2 / range;
    m[3] = glm::vec4(0, 0, -sum / range, 1);
  } else {
    m[2] = glm::vec4(-p.offset * part, -sum / range, -1);
    m[3][2] = -2 * camera.zfar * camera.znear / range;
  }
  return m;
}

namespace {

/// Throws unless the numbers that are zero in every projection matrix are.
void require_projection(const glm::mat4& m) {
  const bool is_perspective = m[2][3] == -1 && m[3] == glm::vec4(0, 0, m[3][2], 0);
  const bool is_orthographic = m[2] == glm::vec4(0, 0, m[2][2], 0) && m[3][3] == 1;
  if (m[0] == glm::vec4(m[0][0], 0, 0, 0) && m[1] == glm::vec4(0, m[1][1], 0, 0) &&
      (is_perspective || is_orthographic))
    return;
  throw InvalidArgument("projection (from_opengl)", "another matrix",
                        "one of glFrustum or glOrtho, acting on column vectors");
}

}  // namespace

Camera from_opengl(const glm::mat4& view, const glm::mat4& projection, int width, int height) {
  const glm::mat4& m = projection;
  require_projection(m);
  const double half_width = 0.5 * width, half_height = 0.5 * height, a = m[2][2], b = m[3][2];
  Camera camera;
  camera.view = view;
  if (m[3][3] == 1) {
    constexpr double k_tolerance = 1e-5;
    if (m[3][0] != 0 || m[3][1] != 0 ||
        !(std::abs(m[0][0] * half_width / (m[1][1] * half_height) - 1) < k_tolerance))
      throw InvalidArgument("projection (from_opengl)", "an orthographic one off the centre or stretched",
                            "square pixels, and the axis through the image's centre");
    camera.orthographic_height = static_cast<float>(2.0 / m[1][1]);
    camera.znear = static_cast<float>((b + 1) / a);
    camera.zfar = static_cast<float>((b - 1) / a);
  } else {
    camera.intrinsics = Intrinsics{
        static_cast<float>(m[0][0] * half_width), static_cast<float>(m[1][1] * half_height),
        static_cast<float>(half_width * (1.0 - m[2][0])), static_cast<float>(half_height * (1.0 + m[2][1]))};
    camera.znear = static_cast<float>(b / (a - 1));
    camera.zfar = static_cast<float>(b / (a + 1));
  }
  validate(camera, "from_opengl");
  return camera;
}

}  // namespace dpr
