/// Reference for the reflection of rough surfaces, as glTF 2.0 has it in appendix B: GGX's distribution of facets,
/// Smith's masking with heights that correlate, Schlick's Fresnel term. Numbers carry their derivatives.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace dpr::reference {

/// A number and its derivatives with respect to the four cosines.
struct Dual {
  double value = 0.0;
  std::array<double, 4> slope{};
};

/// Number with these derivatives per unit of two others'.
inline Dual chained(double value, double by_a, const Dual& a, double by_b, const Dual& b) {
  Dual result{value};
  for (std::size_t i = 0; i < 4; ++i) result.slope[i] = by_a * a.slope[i] + by_b * b.slope[i];
  return result;
}
inline Dual operator+(const Dual& a, const Dual& b) { return chained(a.value + b.value, 1.0, a, 1.0, b); }
inline Dual operator-(const Dual& a, const Dual& b) { return chained(a.value - b.value, 1.0, a, -1.0, b); }
inline Dual operator*(const Dual& a, const Dual& b) {
  return chained(a.value * b.value, b.value, a, a.value, b);
}
inline Dual operator/(const Dual& a, const Dual& b) {
  const double quotient = a.value / b.value;
  return chained(quotient, 1.0 / b.value, a, -quotient / b.value, b);
}
inline Dual sqrt(const Dual& a) {
  const double root = std::sqrt(a.value);
  return chained(root, 0.5 / root, a, 0.0, a);
}
inline Dual clamped(const Dual& a, double low, double high) {
  return a.value < low ? Dual{low} : a.value > high ? Dual{high} : a;
}

/// alpha^2 of GGX, alpha being the square of glTF's roughness.
inline double squared_alpha(double shininess) { return std::max(2.0 / (shininess + 1.0), 1e-6); }

/// Shares of a light that a surface turned to it reflects: times diffuse and 1 - F0, specular and F0, specular.
struct Reflection {
  Dual scattered, straight, grazing;
};

/// `cosines`: n.l (above 0), n.v, n.h, v.h.
inline Reflection reflection(const std::array<double, 4>& cosines, double shininess) {
  std::array<Dual, 4> c;
  for (std::size_t i = 0; i < 4; ++i) {
    c[i].value = cosines[i];
    c[i].slope[i] = 1.0;
  }
  const Dual one{1.0}, half{0.5}, squared{squared_alpha(shininess)};
  const Dual light = c[0], eye = clamped(c[1], 1e-4, 2.0), halfway = clamped(c[2], 0.0, 1.0),
             both = clamped(c[3], 0.0, 1.0);
  const Dual ratio = one + halfway * halfway * (squared - one);
  const Dual distribution = squared / (Dual{std::numbers::pi} * ratio * ratio);
  const auto slope = [&](const Dual& cosine) { return sqrt(squared + cosine * cosine * (one - squared)); };
  const Dual masking = half / clamped(light * slope(eye) + eye * slope(light), 1e-6, 4.0);
  const Dual lobe = Dual{std::numbers::pi} * distribution * masking * light;
  const Dual away = one - both, power = away * away * away * away * away;
  return {light * (one - power), lobe * (one - power), lobe * power};
}

}  // namespace dpr::reference
