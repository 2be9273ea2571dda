/// Reference for the opacity stage: a triangle covers a pixel with its opacity times its occupancy.
#pragma once

#include "occupancy.hpp"
#include "scene.hpp"

#include <algorithm>
#include <cmath>

namespace dpr::reference {

/// Of the corners of a face; 1 where the mesh gives none.
inline Vec3d corner_opacities(const Mesh& mesh, std::size_t face) {
  if (!mesh.face_opacities.empty()) {
    const double opacity = mesh.face_opacities[face];
    return {opacity, opacity, opacity};
  }
  if (mesh.vertex_opacities.empty()) return {1.0, 1.0, 1.0};
  const Face& f = mesh.faces[face];
  return {mesh.vertex_opacities[f[0]], mesh.vertex_opacities[f[1]], mesh.vertex_opacities[f[2]]};
}

/// No more than 1, which the weights' rounding would make it.
inline double opacity_at(const Vec3d& corners, const Vec3d& barycentric) {
  return std::min(dot(corners, barycentric), 1.0);
}

inline Occupancy opacity_forward(const Occupancy& of_surface, const Vec3d& corners,
                                 const Vec3d& barycentric) {
  const double opacity = opacity_at(corners, barycentric);
  return {opacity * of_surface.p, of_surface.log_p + std::log(opacity)};
}

struct OpacityGradient {
  double p = 0.0, log_p = 0.0;  ///< of the surface's
  Vec3d corners, barycentric;
};

inline OpacityGradient opacity_backward(const Occupancy& of_surface, const Vec3d& corners,
                                        const Vec3d& barycentric, double grad_p, double grad_log_p) {
  const double opacity = opacity_at(corners, barycentric),
               grad = grad_p * of_surface.p + grad_log_p / opacity;
  return {opacity * grad_p, grad_log_p, grad * barycentric, grad * corners};
}

/// Adds the gradient of a face's corners to that of the mesh's opacities.
inline void add_opacity_gradient(const Mesh& mesh, std::size_t face, const Vec3d& corners,
                                 std::vector<double>& grad) {
  if (!mesh.face_opacities.empty()) grad[face] += corners.x + corners.y + corners.z;
  for (std::size_t i = 0; i < 3 && !mesh.vertex_opacities.empty(); ++i)
    grad[mesh.faces[face][i]] += corners[i];
}

}  // namespace dpr::reference
