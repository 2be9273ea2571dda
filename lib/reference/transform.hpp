/// Reference for the transform stage: object -> world -> view -> (distortion) -> NDC and depth, and the
/// derivatives of every parameter.
///
/// NDC: x right, y up, [-1, 1] on the short side of the image. View space has OpenGL axes (looks down -z), so
/// the depth, the distance along the view direction, is -z.
#pragma once

#include "vec.hpp"

#include <algorithm>
#include <array>
#include <numbers>
#include <optional>

namespace dpr::reference {

struct ImageSize {
  int width = 0;
  int height = 0;
};

inline double short_side(const ImageSize& size) { return std::min(size.width, size.height); }

/// Centre of the pixel (column, row), row 0 on top, in NDC.
inline Vec2d pixel_center(int column, int row, const ImageSize& size) {
  return {(2.0 * column + 1.0 - size.width) / short_side(size),
          (size.height - 2.0 * row - 1.0) / short_side(size)};
}

/// Pinhole in pixels; the origin is the corner of the top-left pixel, y down.
struct Intrinsics {
  double fx = 0.0;
  double fy = 0.0;
  double cx = 0.0;
  double cy = 0.0;
};

/// OpenCV's k1, k2, p1, p2, k3, or of its fisheye k1, k2, k3, k4, 0.
using Coefficients = std::array<double, 5>;

struct Distortion {
  Coefficients coefficients{};
  bool is_fisheye = false;
};

/// Angle at which a fisheye shows a point that many radians from the axis, and the derivative.
struct ShownAngle {
  double value = 0.0;
  double slope = 0.0;
};
inline ShownAngle shown_angle(const Coefficients& k, double angle) {
  ShownAngle shown{angle, 1.0};
  for (std::size_t i = 0; i < 4; ++i) {
    const double power = 2.0 * static_cast<double>(i) + 3.0;
    shown.value += k[i] * std::pow(angle, power);
    shown.slope += k[i] * power * std::pow(angle, power - 1.0);
  }
  return shown;
}

/// A point of OpenCV's normalised image plane, y down, and where its lens shows it; as its documentation has
/// it.
inline Vec2d distorted(const Distortion& lens, const Vec2d& point) {
  if (lens.is_fisheye) {
    const double r = std::hypot(point.x, point.y);
    return r > 0.0 ? shown_angle(lens.coefficients, std::atan(r)).value / r * point : point;
  }
  const auto [k1, k2, p1, p2, k3] = lens.coefficients;
  const double x = point.x, y = point.y, r2 = x * x + y * y;
  const double radial = 1.0 + k1 * r2 + k2 * r2 * r2 + k3 * r2 * r2 * r2;
  return {x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
          y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y};
}

struct DistortedGradient {
  Vec2d point;
  Coefficients coefficients{};
};

/// Along the direction from the axis a point moves by the slope of the angle shown, across it by the factor.
inline DistortedGradient fisheye_backward(const Coefficients& k, const Vec2d& point, const Vec2d& grad) {
  const double r = std::hypot(point.x, point.y);
  if (r == 0.0) return {grad, {}};
  const double angle = std::atan(r), along = dot(grad, point) / r;
  const ShownAngle shown = shown_angle(k, angle);
  const double across_factor = shown.value / r, along_factor = shown.slope / (1.0 + r * r);
  DistortedGradient g{across_factor * grad + (along_factor - across_factor) * along / r * point, {}};
  for (std::size_t i = 0; i < 4; ++i)
    g.coefficients[i] = along * std::pow(angle, 2.0 * static_cast<double>(i) + 3.0);
  return g;
}

inline DistortedGradient distorted_backward(const Distortion& lens, const Vec2d& point, const Vec2d& grad) {
  if (lens.is_fisheye) return fisheye_backward(lens.coefficients, point, grad);
  const auto [k1, k2, p1, p2, k3] = lens.coefficients;
  const double x = point.x, y = point.y, r2 = x * x + y * y;
  const double radial = 1.0 + k1 * r2 + k2 * r2 * r2 + k3 * r2 * r2 * r2;
  const double slope = k1 + 2.0 * k2 * r2 + 3.0 * k3 * r2 * r2;  // of `radial`, by r2
  const double xx = radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x;
  const double xy = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
  const double yy = radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x;
  const double along = grad.x * x + grad.y * y;
  return {{grad.x * xx + grad.y * xy, grad.x * xy + grad.y * yy},
          {along * r2, along * r2 * r2, 2.0 * grad.x * x * y + grad.y * (r2 + 2.0 * y * y),
           grad.x * (r2 + 2.0 * x * x) + 2.0 * grad.y * x * y, along * r2 * r2 * r2}};
}

struct Camera {
  Mat4d view = k_identity;  ///< world to view
  double fov_y_degrees = 60.0;
  std::optional<Intrinsics> intrinsics;  ///< replaces fov_y_degrees
  double znear = 1.0;
  double zfar = 100.0;
  std::optional<Distortion> distortion;
  std::optional<double> orthographic_height;  ///< replaces both
};

/// x_ndc = scale.x * x / depth + offset.x, and the same in y, for x, y in view space; orthographic without
/// the division. A lens distorts x / depth and y / depth before.
struct Projection {
  Vec2d scale;
  Vec2d offset;
  bool is_orthographic = false;
  std::optional<Distortion> distortion;
};

inline Projection make_projection(const Camera& camera, const ImageSize& size) {
  const double side = short_side(size);
  if (camera.orthographic_height) {
    const double scale = 2.0 * size.height / side / *camera.orthographic_height;
    return {{scale, scale}, {}, true, {}};
  }
  if (camera.intrinsics) {
    const Intrinsics& k = *camera.intrinsics;
    return {{2.0 * k.fx / side, 2.0 * k.fy / side},
            {(2.0 * k.cx - size.width) / side, (size.height - 2.0 * k.cy) / side},
            false,
            camera.distortion};
  }
  const double half_angle = 0.5 * camera.fov_y_degrees * std::numbers::pi / 180.0;
  const double scale = size.height / side / std::tan(half_angle);
  return {{scale, scale}, {}, false, camera.distortion};
}

struct ProjectionGradient {
  double fov_y_degrees = 0.0;
  Intrinsics intrinsics;
  double orthographic_height = 0.0;
};

/// Whichever of the three the camera does not use has the gradient zero.
inline ProjectionGradient projection_backward(const Camera& camera, const ImageSize& size,
                                              const Projection& grad) {
  const double side = short_side(size);
  ProjectionGradient result;
  if (camera.orthographic_height) {
    const double extent = *camera.orthographic_height;
    result.orthographic_height = -(grad.scale.x + grad.scale.y) * 2.0 * size.height / side / extent / extent;
    return result;
  }
  if (camera.intrinsics) {
    result.intrinsics = {2.0 * grad.scale.x / side, 2.0 * grad.scale.y / side, 2.0 * grad.offset.x / side,
                         -2.0 * grad.offset.y / side};
    return result;
  }
  const double half_degree = 0.5 * std::numbers::pi / 180.0;
  const double sine = std::sin(half_degree * camera.fov_y_degrees);
  result.fov_y_degrees = -(grad.scale.x + grad.scale.y) * size.height / side * half_degree / (sine * sine);
  return result;
}

struct TransformedVertex {
  Vec3d world;
  Vec3d view;
  Vec3d ndc;          ///< x, y in NDC; z is the depth, positive in front
  Vec3d homogeneous;  ///< without distortion: x, y in NDC times depth, orthographic times 1; depth
};

/// NDC and depth of homogeneous coordinates.
inline Vec3d project(const Vec3d& h, const Projection& p) {
  if (p.is_orthographic) return h;
  Vec2d ndc = {h.x / h.z, h.y / h.z};
  if (p.distortion) {
    const Vec2d seen =
        distorted(*p.distortion, {(ndc.x - p.offset.x) / p.scale.x, -(ndc.y - p.offset.y) / p.scale.y});
    ndc = {p.scale.x * seen.x + p.offset.x, -p.scale.y * seen.y + p.offset.y};
  }
  return {ndc.x, ndc.y, h.z};
}

inline TransformedVertex transform_forward(const Vec3d& position, const Mat4d& model, const Mat4d& view,
                                           const Projection& projection) {
  TransformedVertex v;
  v.world = linear_part(model) * position + translation_part(model);
  v.view = linear_part(view) * v.world + translation_part(view);
  const double depth = -v.view.z, w = projection.is_orthographic ? 1.0 : depth;
  v.homogeneous = {projection.scale.x * v.view.x + projection.offset.x * w,
                   projection.scale.y * v.view.y + projection.offset.y * w, depth};
  v.ndc = project(v.homogeneous, projection);
  return v;
}

/// Rotations are derivatives at zero of a rotation vector r (radians) in A <- exp([r]x) A, A the linear part
/// of the 4x4 matrix, its translation column left alone; translations are derivatives of that column.
struct TransformGradient {
  Vec3d position;  ///< object space
  Vec3d model_rotation;
  Vec3d model_translation;
  Vec3d view_rotation;
  Vec3d view_translation;
  Projection projection;  ///< of scale and offset
  Coefficients distortion{};
};

/// The gradients by way of NDC x, y and depth.
inline Vec3d ndc_backward(const Vec3d& view, const Projection& projection, const Vec3d& grad_ndc,
                          TransformGradient& g) {
  const Vec2d grad_seen = {grad_ndc.x * projection.scale.x, grad_ndc.y * projection.scale.y};
  g.projection.offset = {grad_ndc.x, grad_ndc.y};
  if (projection.is_orthographic) {
    g.projection.scale = {grad_ndc.x * view.x, grad_ndc.y * view.y};
    return {grad_seen.x, grad_seen.y, -grad_ndc.z};
  }
  const double inverse_depth = -1.0 / view.z;
  const Vec2d slope = {view.x * inverse_depth, view.y * inverse_depth};
  Vec2d seen = slope, grad_slope = grad_seen;
  if (projection.distortion) {
    const Vec2d down = {slope.x, -slope.y};
    seen = distorted(*projection.distortion, down);
    seen.y = -seen.y;
    const DistortedGradient d = distorted_backward(*projection.distortion, down, {grad_seen.x, -grad_seen.y});
    grad_slope = {d.point.x, -d.point.y};
    g.distortion = d.coefficients;
  }
  g.projection.scale = {grad_ndc.x * seen.x, grad_ndc.y * seen.y};
  const double grad_depth = grad_ndc.z - inverse_depth * dot(grad_slope, slope);
  return {inverse_depth * grad_slope.x, inverse_depth * grad_slope.y, -grad_depth};
}

/// `grad_ndc` belongs to NDC x, y and depth, `grad_world` to the world position (from the lighting),
/// `grad_homogeneous` to the homogeneous coordinates (from faces that cross the near plane).
inline TransformGradient transform_backward(const Vec3d& position, const Mat4d& model, const Mat4d& view,
                                            const Projection& projection, const Vec3d& grad_ndc,
                                            const Vec3d& grad_world, const Vec3d& grad_homogeneous = {}) {
  TransformGradient g;
  const TransformedVertex v = transform_forward(position, model, view, projection);
  Vec3d grad_total_world = grad_world;
  // A vertex of discarded triangles only may lie in the camera's plane, where 0 / 0 would turn no gradient
  // into NaN.
  if (grad_ndc.x != 0.0 || grad_ndc.y != 0.0 || grad_ndc.z != 0.0) {
    const Vec3d grad_view = ndc_backward(v.view, projection, grad_ndc, g);
    g.view_rotation = cross(linear_part(view) * v.world, grad_view);
    g.view_translation = grad_view;
    grad_total_world += transposed_times(linear_part(view), grad_view);
  }
  const Vec3d& h = grad_homogeneous;
  const bool ortho = projection.is_orthographic;
  const double grad_w = ortho ? 0.0 : h.x * projection.offset.x + h.y * projection.offset.y;
  const Vec3d grad_view = {h.x * projection.scale.x, h.y * projection.scale.y, -h.z - grad_w};
  const double w = ortho ? 1.0 : -v.view.z;
  g.projection.scale += {h.x * v.view.x, h.y * v.view.y};
  g.projection.offset += {h.x * w, h.y * w};
  g.view_rotation += cross(linear_part(view) * v.world, grad_view);
  g.view_translation += grad_view;
  grad_total_world += transposed_times(linear_part(view), grad_view);
  g.model_rotation = cross(linear_part(model) * position, grad_total_world);
  g.model_translation = grad_total_world;
  g.position = transposed_times(linear_part(model), grad_total_world);
  return g;
}

/// The translation from which the camera's centre is computed. An orthographic camera stands very far behind,
/// whatever its view's translation.
inline Vec3d center_translation(const Camera& camera) {
  constexpr double k_far_away = 1e8;
  return camera.orthographic_height ? Vec3d{0.0, 0.0, -k_far_away} : translation_part(camera.view);
}

/// World position of the camera.
inline Vec3d camera_center(const Camera& camera) {
  return -(inverse(linear_part(camera.view)) * center_translation(camera));
}

struct ViewGradient {
  Vec3d rotation;
  Vec3d translation;
};

/// With c = -A^-1 t and A <- exp([r]x) A: dc = A^-1 (r x t - dt).
inline ViewGradient camera_center_backward(const Camera& camera, const Vec3d& grad_center) {
  const Vec3d h = transposed_times(inverse(linear_part(camera.view)), grad_center);
  return {cross(center_translation(camera), h), camera.orthographic_height ? Vec3d{} : -h};
}

/// A normal as a transform turns the plane that it is normal to, of length one.
inline Vec3d transformed_normal(const Mat4d& m, const Vec3d& normal) {
  const Mat3d linear = linear_part(m);
  const bool is_along_x = std::fabs(normal.x) >= 0.5 * length(normal);
  const Vec3d other = is_along_x ? Vec3d{0.0, 1.0, 0.0} : Vec3d{1.0, 0.0, 0.0};
  const Vec3d u = cross(normal, other), v = cross(normal, u);
  const Vec3d turned = cross(linear * u, linear * v);
  return unit(dot(turned, linear * normal) < 0.0 ? -turned : turned);
}

}  // namespace dpr::reference
