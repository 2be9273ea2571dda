/// Reference for the rasterize stage: the fragments of a pixel with signed distance, barycentrics and depth.
/// Le Lidec et al. 2021, section 3.1, (1)-(2): s > 0 inside the projected triangle.
#pragma once

#include "vec.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

namespace dpr::reference {

using Face = std::array<std::size_t, 3>;

/// Vertices of a projected triangle: x, y in NDC, z the depth.
using NdcTriangle = std::array<Vec3d, 3>;

/// Signed distance: squared (NDC^2), as in SoftRas and PyTorch3D with the opposite sign, or Euclidean (NDC).
enum class DistanceMetric { squared, euclidean };

struct RasterizeParameters {
  double blur_radius = 0.0;  ///< unit of the metric; triangles at this distance or beyond are no fragments
  DistanceMetric metric = DistanceMetric::squared;
  bool perspective_correct = true;
  bool clip_barycentric = true;  ///< negatives to zero, rescaled to sum 1
  double znear = 1.0;
  double zfar = 100.0;
};

struct Fragment {
  std::size_t face = 0;
  double distance = 0.0;  ///< signed, positive inside; at 0 the sign bit says so
  double depth = 0.0;
  Vec3d barycentric;  ///< c_i: perspective corrected and clipped as asked
};

/// Twice the area in NDC^2 at which a triangle covers the samples that it owns and is not blurred: rounding
/// leaves nothing of its barycentrics.
inline constexpr double k_sliver_area = 1e-12;

inline Vec2d screen(const Vec3d& vertex) { return {vertex.x, vertex.y}; }

/// Twice the signed area, positive when counter-clockwise with y up.
inline double double_area(const NdcTriangle& t) {
  return cross(screen(t[1]) - screen(t[0]), screen(t[2]) - screen(t[0]));
}

/// Whole triangles are discarded: without area, any vertex before znear or behind zfar (see clip.hpp for
/// what is left where others are not). Written so that NaN is discarded.
inline bool is_discarded(const NdcTriangle& t, const RasterizeParameters& p) {
  const double nearest = std::min({t[0].z, t[1].z, t[2].z});
  const double furthest = std::max({t[0].z, t[1].z, t[2].z});
  if (!(nearest >= p.znear && furthest <= p.zfar)) return true;
  return !(std::fabs(double_area(t)) > 0.0);
}

/// Screen barycentrics b_i of the point: sub-triangle opposite to vertex i over the whole.
inline Vec3d screen_barycentric(const NdcTriangle& t, const Vec2d& point) {
  Vec3d b;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec2d u = screen(t[(i + 1) % 3]);
    const Vec2d v = screen(t[(i + 2) % 3]);
    b[i] = cross(v - u, point - u) / double_area(t);
  }
  return b;
}

/// Point of the triangle's outline nearest to a given one.
struct NearestEdge {
  double squared_distance = 0.0;
  std::size_t edge = 0;    ///< from vertex `edge` to the next
  double parameter = 0.0;  ///< 0 at its start, 1 at its end
  Vec2d difference;        ///< given point minus nearest point
};

inline NearestEdge nearest_edge(const NdcTriangle& t, const Vec2d& point) {
  NearestEdge best;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec2d start = screen(t[i]);
    const Vec2d along = screen(t[(i + 1) % 3]) - start;
    const double squared_length = dot(along, along);
    const double at =
        squared_length > 0.0 ? std::clamp(dot(point - start, along) / squared_length, 0.0, 1.0) : 0.0;
    const Vec2d difference = point - (start + at * along);
    const double squared_distance = dot(difference, difference);
    if (i == 0 || squared_distance < best.squared_distance) best = {squared_distance, i, at, difference};
  }
  return best;
}

/// +1 where the point belongs to the left of the edge a -> b, else -1. The ends are taken in one order, so
/// that the triangles on both sides see one rounding. A point on the edge itself belongs to the left where
/// the edge goes down, or level and to the left: of a counter-clockwise triangle these are the left and the
/// upper edges.
inline double side_of_edge(const Vec2d& a, const Vec2d& b, const Vec2d& point) {
  const bool falls = b.y < a.y || (b.y == a.y && b.x < a.x);
  const double side = falls ? cross(a - b, point - b) : cross(b - a, point - a);
  return (falls ? side <= 0.0 : side > 0.0) ? 1.0 : -1.0;
}

/// True if the triangle owns the sample. Exactly one of the triangles that share an edge does.
inline bool is_inside(const NdcTriangle& t, const Vec2d& point) {
  const double orientation = double_area(t);
  for (std::size_t i = 0; i < 3; ++i) {
    if (!(side_of_edge(screen(t[i]), screen(t[(i + 1) % 3]), point) * orientation > 0.0)) return false;
  }
  return true;
}

/// Numerators n_i of the barycentrics before clipping: b_i, or b_i z_j z_k for perspective correct
/// interpolation. Where the pixel lies beyond the horizon of the triangle's plane sum n < 0; dividing by it
/// turns every sign, and so does `sign` here: it is the corrected n_i / sum n that are clipped, not the n_i.
struct Numerators {
  Vec3d n;
  double sign = 1.0;
};

inline Numerators barycentric_numerators(const NdcTriangle& t, const Vec3d& b, const RasterizeParameters& p) {
  if (!p.perspective_correct) return {b, 1.0};
  const Vec3d n = {b.x * t[1].z * t[2].z, b.y * t[2].z * t[0].z, b.z * t[0].z * t[1].z};
  const double sign = n.x + n.y + n.z < 0.0 ? -1.0 : 1.0;
  return {sign * n, sign};
}

inline Vec3d clipped(const Vec3d& n, const RasterizeParameters& p) {
  return p.clip_barycentric ? Vec3d{std::max(n.x, 0.0), std::max(n.y, 0.0), std::max(n.z, 0.0)} : n;
}

/// The fragment of triangle `face` at the pixel centre `point`, if it has one. The triangle must not be
/// discarded.
inline std::optional<Fragment> rasterize_forward(const NdcTriangle& t, std::size_t face, const Vec2d& point,
                                                 const RasterizeParameters& p) {
  const Vec3d b = screen_barycentric(t, point);
  const bool inside = is_inside(t, point);
  const double squared = nearest_edge(t, point).squared_distance;
  const double magnitude = p.metric == DistanceMetric::squared ? squared : std::sqrt(squared);
  const bool is_sliver = std::fabs(double_area(t)) <= k_sliver_area;
  if (!inside && (is_sliver || !(magnitude < p.blur_radius))) return std::nullopt;

  const Vec3d m = clipped(barycentric_numerators(t, b, p).n, p);
  Fragment fragment;
  fragment.face = face;
  fragment.distance = inside ? magnitude : -magnitude;
  fragment.barycentric = (1.0 / (m.x + m.y + m.z)) * m;
  fragment.depth = dot(fragment.barycentric, {t[0].z, t[1].z, t[2].z});
  return fragment;
}

struct FragmentGradient {
  double distance = 0.0;
  double depth = 0.0;
  Vec3d barycentric;
};

/// Distance to the vertices in NDC. By the envelope theorem the nearest point may be held at its place on the
/// edge.
inline void distance_backward(const NdcTriangle& t, const Vec2d& point, const RasterizeParameters& p,
                              double grad_distance, NdcTriangle& grad) {
  const NearestEdge edge = nearest_edge(t, point);
  double scale = is_inside(t, point) ? grad_distance : -grad_distance;
  if (p.metric == DistanceMetric::euclidean) {
    // On the outline the Euclidean distance has no derivative: none is passed.
    scale = edge.squared_distance > 0.0 ? scale / (2.0 * std::sqrt(edge.squared_distance)) : 0.0;
  }
  const Vec2d grad_nearest = (-2.0 * scale) * edge.difference;
  const Vec2d at_start = (1.0 - edge.parameter) * grad_nearest;
  const Vec2d at_end = edge.parameter * grad_nearest;
  grad[edge.edge] += {at_start.x, at_start.y, 0.0};
  grad[(edge.edge + 1) % 3] += {at_end.x, at_end.y, 0.0};
}

/// Screen barycentrics to the vertices in NDC: b_i = e_i / a with e_i = cross(v - u, point - u).
inline void screen_barycentric_backward(const NdcTriangle& t, const Vec2d& point, const Vec3d& grad_b,
                                        NdcTriangle& grad) {
  const double area = double_area(t);
  const double grad_area = -dot(grad_b, screen_barycentric(t, point)) / area;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    const std::size_t k = (i + 2) % 3;
    const Vec2d u = screen(t[j]);
    const Vec2d v = screen(t[k]);
    const double g = grad_b[i] / area;
    grad[j] += {g * (v.y - point.y), g * (point.x - v.x), 0.0};
    grad[k] += {g * (point.y - u.y), g * (u.x - point.x), 0.0};
    grad[i] += {grad_area * (u.y - v.y), grad_area * (v.x - u.x), 0.0};
  }
}

/// Gradient to the vertices: x, y in NDC and z the depth.
inline NdcTriangle rasterize_backward(const NdcTriangle& t, const Vec2d& point, const RasterizeParameters& p,
                                      const FragmentGradient& grad_fragment) {
  NdcTriangle grad{};
  const Vec3d b = screen_barycentric(t, point);
  const auto [n, sign] = barycentric_numerators(t, b, p);
  const Vec3d m = clipped(n, p);
  const double total = m.x + m.y + m.z;
  const Vec3d c = (1.0 / total) * m;

  const Vec3d grad_c = grad_fragment.barycentric + grad_fragment.depth * Vec3d{t[0].z, t[1].z, t[2].z};
  const double mean = dot(grad_c, c);
  Vec3d grad_b;
  for (std::size_t i = 0; i < 3; ++i) {
    grad[i].z += grad_fragment.depth * c[i];
    if (p.clip_barycentric && !(n[i] > 0.0)) continue;
    const double grad_n = sign * (grad_c[i] - mean) / total;
    if (!p.perspective_correct) {
      grad_b[i] = grad_n;
      continue;
    }
    const std::size_t j = (i + 1) % 3;
    const std::size_t k = (i + 2) % 3;
    grad_b[i] = grad_n * t[j].z * t[k].z;
    grad[j].z += grad_n * b[i] * t[k].z;
    grad[k].z += grad_n * b[i] * t[j].z;
  }
  screen_barycentric_backward(t, point, grad_b, grad);
  distance_backward(t, point, p, grad_fragment.distance, grad);
  return grad;
}

}  // namespace dpr::reference
