/// Small vectors and matrices in double precision for the reference renderer: nothing but what its stages
/// need.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace dpr::reference {

struct Vec2d {
  double x = 0.0;
  double y = 0.0;
};

inline Vec2d operator+(const Vec2d& a, const Vec2d& b) { return {a.x + b.x, a.y + b.y}; }
inline Vec2d operator-(const Vec2d& a, const Vec2d& b) { return {a.x - b.x, a.y - b.y}; }
inline Vec2d operator*(double s, const Vec2d& a) { return {s * a.x, s * a.y}; }
inline Vec2d& operator+=(Vec2d& a, const Vec2d& b) { return a = a + b; }
inline double dot(const Vec2d& a, const Vec2d& b) { return a.x * b.x + a.y * b.y; }
/// z component of the cross product: twice the signed area of the triangle (0, a, b).
inline double cross(const Vec2d& a, const Vec2d& b) { return a.x * b.y - a.y * b.x; }

struct Vec3d {
  double x = 0.0;
  double y = 0.0;
  double z = 0.0;

  double& operator[](std::size_t i) { return i == 0 ? x : (i == 1 ? y : z); }
  double operator[](std::size_t i) const { return i == 0 ? x : (i == 1 ? y : z); }
};

inline Vec3d operator+(const Vec3d& a, const Vec3d& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3d operator-(const Vec3d& a, const Vec3d& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3d operator-(const Vec3d& a) { return {-a.x, -a.y, -a.z}; }
inline Vec3d operator*(double s, const Vec3d& a) { return {s * a.x, s * a.y, s * a.z}; }
/// Component by component, as colours multiply.
inline Vec3d operator*(const Vec3d& a, const Vec3d& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
inline Vec3d& operator+=(Vec3d& a, const Vec3d& b) { return a = a + b; }
inline double dot(const Vec3d& a, const Vec3d& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline double length(const Vec3d& a) { return std::sqrt(dot(a, a)); }
inline Vec3d cross(const Vec3d& a, const Vec3d& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/// Below this length a vector has no direction: normals of degenerate triangles, a light on the surface.
inline constexpr double k_no_direction = 1e-20;

/// Unit vector of `a`, or zero where `a` has no direction.
inline Vec3d unit(const Vec3d& a) {
  const double norm = length(a);
  return norm > k_no_direction ? (1.0 / norm) * a : Vec3d{};
}

/// Gradient with respect to `a` of `unit(a)`: what is perpendicular to the direction, over the length; zero
/// for no direction.
inline Vec3d unit_backward(const Vec3d& a, const Vec3d& grad_unit) {
  const double norm = length(a);
  if (!(norm > k_no_direction)) return {};
  const Vec3d direction = (1.0 / norm) * a;
  return (1.0 / norm) * (grad_unit - dot(direction, grad_unit) * direction);
}

/// Rows of a 3x3 matrix that acts on column vectors.
using Mat3d = std::array<Vec3d, 3>;
/// Row-major 4x4 matrix that acts on column vectors; the last row of an affine map is 0 0 0 1.
using Mat4d = std::array<std::array<double, 4>, 4>;

inline constexpr Mat4d k_identity = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}};

inline Mat3d linear_part(const Mat4d& m) {
  Mat3d a;
  for (std::size_t i = 0; i < 3; ++i) a[i] = {m[i][0], m[i][1], m[i][2]};
  return a;
}

inline Vec3d translation_part(const Mat4d& m) { return {m[0][3], m[1][3], m[2][3]}; }

inline Vec3d operator*(const Mat3d& a, const Vec3d& v) { return {dot(a[0], v), dot(a[1], v), dot(a[2], v)}; }

/// Product of the transpose of `a` with `v`.
inline Vec3d transposed_times(const Mat3d& a, const Vec3d& v) { return v.x * a[0] + v.y * a[1] + v.z * a[2]; }

/// Inverse by cofactors; `a` must be regular.
inline Mat3d inverse(const Mat3d& a) {
  const Vec3d c0 = cross(a[1], a[2]);
  const Vec3d c1 = cross(a[2], a[0]);
  const Vec3d c2 = cross(a[0], a[1]);
  const double scale = 1.0 / dot(a[0], c0);
  return {Vec3d{scale * c0.x, scale * c1.x, scale * c2.x}, Vec3d{scale * c0.y, scale * c1.y, scale * c2.y},
          Vec3d{scale * c0.z, scale * c1.z, scale * c2.z}};
}

}  // namespace dpr::reference
