/// Reference for the transform stage: object -> world -> view -> NDC and depth, and the derivatives of every
/// parameter.
///
/// NDC: x right, y up, [-1, 1] on the short side of the image. View space has OpenGL axes (looks down -z), so
/// the depth, the distance along the view direction, is -z.
#pragma once

#include "vec.hpp"

#include <algorithm>
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

struct Camera {
  Mat4d view = k_identity;  ///< world to view
  double fov_y_degrees = 60.0;
  std::optional<Intrinsics> intrinsics;  ///< replaces fov_y_degrees
  double znear = 1.0;
  double zfar = 100.0;
};

/// x_ndc = scale.x * x / depth + offset.x, and the same in y, for x, y in view space.
struct Projection {
  Vec2d scale;
  Vec2d offset;
};

inline Projection make_projection(const Camera& camera, const ImageSize& size) {
  const double side = short_side(size);
  if (camera.intrinsics) {
    const Intrinsics& k = *camera.intrinsics;
    return {{2.0 * k.fx / side, 2.0 * k.fy / side},
            {(2.0 * k.cx - size.width) / side, (size.height - 2.0 * k.cy) / side}};
  }
  const double half_angle = 0.5 * camera.fov_y_degrees * std::numbers::pi / 180.0;
  const double scale = size.height / side / std::tan(half_angle);
  return {{scale, scale}, {}};
}

struct ProjectionGradient {
  double fov_y_degrees = 0.0;
  Intrinsics intrinsics;
};

/// Whichever of field of view and intrinsics the camera does not use has the gradient zero.
inline ProjectionGradient projection_backward(const Camera& camera, const ImageSize& size,
                                              const Projection& grad) {
  const double side = short_side(size);
  ProjectionGradient result;
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
  Vec3d homogeneous;  ///< x, y in NDC times depth; depth
};

inline TransformedVertex transform_forward(const Vec3d& position, const Mat4d& model, const Mat4d& view,
                                           const Projection& projection) {
  TransformedVertex v;
  v.world = linear_part(model) * position + translation_part(model);
  v.view = linear_part(view) * v.world + translation_part(view);
  const double depth = -v.view.z;
  v.ndc = {projection.scale.x * v.view.x / depth + projection.offset.x,
           projection.scale.y * v.view.y / depth + projection.offset.y, depth};
  v.homogeneous = {projection.scale.x * v.view.x + projection.offset.x * depth,
                   projection.scale.y * v.view.y + projection.offset.y * depth, depth};
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
  Projection projection;
};

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
    const double inverse_depth = 1.0 / v.ndc.z;
    const Vec2d slope = {v.view.x * inverse_depth, v.view.y * inverse_depth};
    const Vec2d grad_slope = {grad_ndc.x * projection.scale.x, grad_ndc.y * projection.scale.y};
    const double grad_depth = grad_ndc.z - inverse_depth * dot(grad_slope, slope);
    const Vec3d grad_view = {inverse_depth * grad_slope.x, inverse_depth * grad_slope.y, -grad_depth};
    g.projection.scale = {grad_ndc.x * slope.x, grad_ndc.y * slope.y};
    g.projection.offset = {grad_ndc.x, grad_ndc.y};
    g.view_rotation = cross(linear_part(view) * v.world, grad_view);
    g.view_translation = grad_view;
    grad_total_world += transposed_times(linear_part(view), grad_view);
  }
  const Vec3d& h = grad_homogeneous;
  const Vec3d grad_view = {h.x * projection.scale.x, h.y * projection.scale.y,
                           -h.z - h.x * projection.offset.x - h.y * projection.offset.y};
  g.projection.scale += {h.x * v.view.x, h.y * v.view.y};
  g.projection.offset += {-h.x * v.view.z, -h.y * v.view.z};
  g.view_rotation += cross(linear_part(view) * v.world, grad_view);
  g.view_translation += grad_view;
  grad_total_world += transposed_times(linear_part(view), grad_view);
  g.model_rotation = cross(linear_part(model) * position, grad_total_world);
  g.model_translation = grad_total_world;
  g.position = transposed_times(linear_part(model), grad_total_world);
  return g;
}

/// World position that the view matrix maps to the origin.
inline Vec3d camera_center(const Mat4d& view) {
  return -(inverse(linear_part(view)) * translation_part(view));
}

struct ViewGradient {
  Vec3d rotation;
  Vec3d translation;
};

/// With c = -A^-1 t and A <- exp([r]x) A: dc = A^-1 (r x t - dt).
inline ViewGradient camera_center_backward(const Mat4d& view, const Vec3d& grad_center) {
  const Vec3d h = transposed_times(inverse(linear_part(view)), grad_center);
  return {cross(translation_part(view), h), -h};
}

}  // namespace dpr::reference
