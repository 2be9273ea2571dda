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

/// Opacity as if it were a base colour, three times the same: the corners' times that of the texture.
inline BaseColor opacity_base(BaseColor base, const Mesh& mesh, std::size_t face) {
  const Vec3d corners = corner_opacities(mesh, face);
  for (std::size_t i = 0; i < 3; ++i) base.corners[i] = {corners[i], corners[i], corners[i]};
  base.texture = nullptr;
  const int texture = face_texture(mesh, face);
  if (texture < 0 || mesh.opacity_textures.empty()) return base;
  const Texture& opacities = mesh.opacity_textures[static_cast<std::size_t>(texture)];
  if (!opacities.texels.empty()) base.texture = &opacities;
  return base;
}

/// No more than 1, which the weights' rounding would make it.
inline double opacity_at(const BaseColor& base, const Vec3d& barycentric) {
  return std::min(base_color(base, barycentric).x, 1.0);
}

inline Occupancy opacity_forward(const Occupancy& of_surface, const BaseColor& base,
                                 const Vec3d& barycentric) {
  const double opacity = opacity_at(base, barycentric);
  return {opacity * of_surface.p, of_surface.log_p + std::log(opacity)};
}

struct OpacityGradient {
  double p = 0.0, log_p = 0.0;    ///< of the surface's
  ShadeFragmentGradient surface;  ///< in the first of three
};

inline OpacityGradient opacity_backward(const Occupancy& of_surface, const BaseColor& base,
                                        const Vec3d& barycentric, double grad_p, double grad_log_p) {
  const double opacity = opacity_at(base, barycentric);
  OpacityGradient grad{opacity * grad_p, grad_log_p, {}};
  base_color_backward(base, barycentric, {grad_p * of_surface.p + grad_log_p / opacity, 0.0, 0.0},
                      grad.surface);
  return grad;
}

/// Adds the gradient of a face's opacity to its mesh's.
template <class MeshGradient>
void add_opacity_gradient(const Mesh& mesh, std::size_t face, const ShadeFragmentGradient& surface,
                          MeshGradient& grad) {
  for (std::size_t i = 0; i < 3; ++i) {
    if (!mesh.face_opacities.empty()) grad.opacities[face] += surface.corners[i].x;
    if (!mesh.vertex_opacities.empty()) grad.opacities[mesh.faces[face][i]] += surface.corners[i].x;
  }
  if (surface.texels.empty()) return;
  std::vector<double>& texels = grad.texel_opacities[static_cast<std::size_t>(face_texture(mesh, face))];
  for (std::size_t i = 0; i < texels.size(); ++i) texels[i] += surface.texels[i].x;
  for (std::size_t i = 0; i < 3; ++i) grad.texcoords[mesh.face_texcoords[face][i]] += surface.texcoords[i];
}

}  // namespace dpr::reference
