/// Reference for faces that cross the near plane, or else the far plane: what is left of them, their fragments and
/// the gradients of these.
///
/// Corners are homogeneous: NDC times depth, and depth. So the way between two of them is straight, whichever
/// side of the camera they lie on; a lens distorts what is left.
#pragma once

#include "rasterize.hpp"
#include "transform.hpp"

#include <limits>
#include <vector>

namespace dpr::reference {

using HomogeneousFace = std::array<Vec3d, 3>;

/// A corner of what is left: x, y in NDC and depth; and its barycentrics in the whole face.
struct OutlineCorner {
  Vec3d ndc;
  Vec3d weights;
};
using Outline = std::vector<OutlineCorner>;

/// A plane of constant depth, and the side of it that is kept.
struct ClipPlane {
  double depth;
  bool is_near;

  bool keeps(const Vec3d& h) const { return is_near ? h.z >= depth : h.z <= depth; }
};

/// The plane that cuts a face: the near one where corners are nearer, or else the far one.
inline ClipPlane plane_of(const HomogeneousFace& face, const RasterizeParameters& p) {
  const ClipPlane near{p.znear, true};
  const bool is_near = std::any_of(face.begin(), face.end(), [&](const Vec3d& h) { return !near.keeps(h); });
  return is_near ? near : ClipPlane{p.zfar, false};
}

inline bool crosses_plane(const HomogeneousFace& face, const RasterizeParameters& p) {
  const ClipPlane plane = plane_of(face, p);
  const auto is_kept = [&](const Vec3d& h) { return plane.keeps(h); };
  return !std::all_of(face.begin(), face.end(), is_kept) && std::any_of(face.begin(), face.end(), is_kept);
}

/// The corners on the side that is kept, and on the plane (Sutherland and Hodgman), from the first kept one behind a
/// lost one on.
inline Outline clip_face(const HomogeneousFace& face, const Projection& projection,
                         const RasterizeParameters& p) {
  const ClipPlane plane = plane_of(face, p);
  const auto is_kept = [&](std::size_t i) { return plane.keeps(face[i % 3]); };
  const auto corner = [](std::size_t i) {
    Vec3d weights;
    weights[i % 3] = 1.0;
    return weights;
  };
  std::size_t first = 0;
  while (!(is_kept(first) && !is_kept(first + 2))) ++first;
  Outline outline;
  for (std::size_t i = first; i < first + 3; ++i) {
    const Vec3d &a = face[i % 3], &b = face[(i + 1) % 3];
    if (is_kept(i)) outline.push_back({project(a, projection), corner(i)});
    if (is_kept(i) == is_kept(i + 1)) continue;
    const double t = (a.z - plane.depth) / (a.z - b.z);
    outline.push_back({project(a + t * (b - a), projection), (1.0 - t) * corner(i) + t * corner(i + 1)});
  }
  return outline;
}

/// Its triangles: one, or two on both sides of the diagonal from the first corner.
inline std::vector<std::array<std::size_t, 3>> triangles_of(const Outline& outline) {
  std::vector<std::array<std::size_t, 3>> list;
  for (std::size_t i = 1; i + 1 < outline.size(); ++i) list.push_back({0, i, i + 1});
  return list;
}

inline NdcTriangle triangle_of(const Outline& outline, const std::array<std::size_t, 3>& corners) {
  return {outline[corners[0]].ndc, outline[corners[1]].ndc, outline[corners[2]].ndc};
}

inline double double_area(const Outline& outline) {
  double area = 0.0;
  for (const auto& corners : triangles_of(outline)) area += double_area(triangle_of(outline, corners));
  return area;
}

inline double squared_distance(const Outline& outline, const Vec2d& point) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Vec2d start = screen(outline[i].ndc), along = screen(outline[(i + 1) % outline.size()].ndc) - start;
    const double squared_length = dot(along, along);
    const double at =
        squared_length > 0.0 ? std::clamp(dot(point - start, along) / squared_length, 0.0, 1.0) : 0.0;
    const Vec2d difference = point - (start + at * along);
    least = std::min(least, dot(difference, difference));
  }
  return least;
}

/// The fragment of a face that crosses the plane, if it has one: its distance is that to the outline, its
/// barycentrics are those of the whole face. Beside the outline, those of the triangle on this side of the
/// diagonal are clipped.
inline std::optional<Fragment> clipped_forward(const HomogeneousFace& h, const Projection& projection,
                                               std::size_t face, const Vec2d& point,
                                               const RasterizeParameters& p) {
  const Outline outline = clip_face(h, projection, p);
  const auto triangles = triangles_of(outline);
  bool inside = false;
  for (const auto& corners : triangles) inside = inside || is_inside(triangle_of(outline, corners), point);
  const double squared = squared_distance(outline, point);
  const double magnitude = p.metric == DistanceMetric::squared ? squared : std::sqrt(squared);
  if (!inside && !(magnitude < p.blur_radius)) return std::nullopt;

  const Vec2d diagonal = screen(outline[2].ndc) - screen(outline[0].ndc);
  const double side = cross(diagonal, point - screen(outline[0].ndc)) * double_area(outline);
  const auto& corners = triangles.size() > 1 && side > 0.0 ? triangles[1] : triangles[0];
  const NdcTriangle t = triangle_of(outline, corners);
  const Vec3d m = clipped(barycentric_numerators(t, screen_barycentric(t, point), p).n, p);
  Fragment fragment;
  fragment.face = face;
  fragment.distance = inside ? magnitude : -magnitude;
  for (std::size_t i = 0; i < 3; ++i) {
    const double c = m[i] / (m.x + m.y + m.z);
    fragment.barycentric += c * outline[corners[i]].weights;
    fragment.depth += c * t[i].z;
  }
  return fragment;
}

/// Of the homogeneous corners, and of the projection and the lens where the corners stay.
struct ClippedGradient {
  HomogeneousFace corners{};
  Projection projection;
  Coefficients distortion{};
};

/// Differences of clipped_forward(), which must have a fragment there.
inline ClippedGradient clipped_backward(const HomogeneousFace& h, const Projection& projection,
                                        const Vec2d& point, RasterizeParameters p,
                                        const FragmentGradient& grad_fragment) {
  constexpr double k_step = 1e-6;  // of the corners' size
  p.blur_radius = std::numeric_limits<double>::infinity();
  const auto value = [&](const HomogeneousFace& moved, const Projection& with) {
    const Fragment f = *clipped_forward(moved, with, 0, point, p);
    return grad_fragment.distance * f.distance + grad_fragment.depth * f.depth +
           dot(grad_fragment.barycentric, f.barycentric);
  };
  ClippedGradient grad;
  for (std::size_t corner = 0; corner < 3; ++corner) {
    const double step = k_step * (1e-3 + length(h[corner]));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      HomogeneousFace above = h, below = h;
      above[corner][axis] += step;
      below[corner][axis] -= step;
      grad.corners[corner][axis] = (value(above, projection) - value(below, projection)) / (2.0 * step);
    }
  }
  if (!projection.distortion) return grad;
  const auto slope = [&](const auto& number) {
    Projection above = projection, below = projection;
    number(above) += k_step;
    number(below) -= k_step;
    return (value(h, above) - value(h, below)) / (2.0 * k_step);
  };
  grad.projection.scale = {slope([](Projection& with) -> double& { return with.scale.x; }),
                           slope([](Projection& with) -> double& { return with.scale.y; })};
  grad.projection.offset = {slope([](Projection& with) -> double& { return with.offset.x; }),
                            slope([](Projection& with) -> double& { return with.offset.y; })};
  for (std::size_t k = 0; k < grad.distortion.size(); ++k)
    grad.distortion[k] = slope([&](Projection& with) -> double& { return with.distortion->coefficients[k]; });
  return grad;
}

}  // namespace dpr::reference
