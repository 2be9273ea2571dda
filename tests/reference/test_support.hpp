/// Support shared by the tests of the reference renderer: fixed random numbers, packing of parameters, moved
/// matrices.
#pragma once

#include "reference/finite_difference.hpp"
#include "reference/renderer.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <random>
#include <vector>

namespace dpr::reference {

inline constexpr std::array k_compositions = {Composition::barrier, Composition::joint};
inline constexpr std::array k_shadings = {Shading::flat, Shading::phong, Shading::gouraud, Shading::blinn,
                                          Shading::microfacet};

/// Uniform numbers that are the same with every standard library.
class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double operator()(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_()) / 4294967296.0;
  }
  Vec3d vector(double low, double high) {
    const double x = (*this)(low, high);
    const double y = (*this)(low, high);
    return {x, y, (*this)(low, high)};
  }

 private:
  std::mt19937 engine_;
};

inline void append(std::vector<double>& list, const Vec3d& v) { list.insert(list.end(), {v.x, v.y, v.z}); }

inline Vec3d take(const std::vector<double>& list, std::size_t first) {
  return {list[first], list[first + 1], list[first + 2]};
}

#define CHECK_GRADIENT(...)                                           \
  do {                                                                \
    const GradientCheck gradient_check = check_gradient(__VA_ARGS__); \
    CAPTURE(gradient_check.error);                                    \
    CAPTURE(gradient_check.worst);                                    \
    CAPTURE(gradient_check.expected);                                 \
    CAPTURE(gradient_check.found);                                    \
    CHECK(gradient_check.passed);                                     \
  } while (false)

inline Mat3d rotation(const Vec3d& r) {
  const double angle = length(r);
  const Vec3d axis = angle > 0.0 ? (1.0 / angle) * r : Vec3d{1.0, 0.0, 0.0};
  Mat3d result;
  for (std::size_t j = 0; j < 3; ++j) {  // Rodrigues, column by column
    Vec3d e;
    e[j] = 1.0;
    const Vec3d column = std::cos(angle) * e + std::sin(angle) * cross(axis, e) +
                         (1.0 - std::cos(angle)) * dot(axis, e) * axis;
    for (std::size_t i = 0; i < 3; ++i) result[i][j] = column[i];
  }
  return result;
}

/// A <- exp([r]x) A, translation column plus t.
inline Mat4d moved(const Mat4d& m, const Vec3d& r, const Vec3d& t) {
  Mat4d result = m;
  for (std::size_t j = 0; j < 3; ++j) {
    const Vec3d column = rotation(r) * Vec3d{m[0][j], m[1][j], m[2][j]};
    for (std::size_t i = 0; i < 3; ++i) result[i][j] = column[i];
  }
  for (std::size_t i = 0; i < 3; ++i) result[i][3] += t[i];
  return result;
}

inline Mat4d scaled(const Vec3d& scale) {
  Mat4d m = k_identity;
  for (std::size_t i = 0; i < 3; ++i) m[i][i] = scale[i];
  return m;
}

}  // namespace dpr::reference
