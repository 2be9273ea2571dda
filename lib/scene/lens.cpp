#include "scene/lens.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

namespace dpr {
namespace {

/// Coefficients from the constant term on.
using Polynomial = std::vector<double>;

double value(std::span<const double> polynomial, double s) {
  double sum = 0;
  for (std::size_t i = polynomial.size(); i-- > 0;) sum = sum * s + polynomial[i];
  return sum;
}

/// The places in (0, most) where a polynomial changes its sign, ascending; each is the last number before.
std::vector<double> sign_changes(const Polynomial& polynomial, double most) {
  if (polynomial.size() < 2) return {};
  Polynomial slope;
  for (std::size_t i = 1; i < polynomial.size(); ++i) slope.push_back(static_cast<double>(i) * polynomial[i]);
  std::vector<double> ends = sign_changes(slope, most), changes;
  ends.push_back(most);
  double low = 0;
  for (const double end : ends) {
    double high = end;
    const bool is_positive = value(polynomial, low) > 0;
    const bool changes_here = (value(polynomial, high) > 0) != is_positive;
    for (double middle = 0.5 * (low + high); changes_here && middle > low && middle < high;
         middle = 0.5 * (low + high))
      ((value(polynomial, middle) > 0) == is_positive ? low : high) = middle;
    if (changes_here) changes.push_back(low);
    low = end;
  }
  return changes;
}

/// The tangents that a fisheye shows at `seen`, by halving, up to k_widest: its pictures reach further, and lines of
/// sight there have no tangents to speak of.
glm::dvec2 without_fisheye(const glm::dvec2& seen, const Distortion& lens) {
  constexpr int k_steps = 50;
  constexpr double k_widest = 5;  // 79 degrees
  const double shown = glm::length(seen);
  double low = 0, high = std::min(largest_radius(lens), k_widest);
  for (int i = 0; i < k_steps; ++i) {
    const double middle = 0.5 * (low + high);
    (middle * radial_factor(lens, middle * middle) < shown ? low : high) = middle;
  }
  return shown > 0 ? low / shown * seen : seen;
}

}  // namespace

bool is_fisheye(const Camera& camera) {
  return camera.distortion && camera.distortion->model == LensModel::fisheye;
}

double radial_factor(const Distortion& d, double radius2) {
  constexpr double k_least = 1e-20;  // squared tangent: the angle is the tangent there
  double angle2 = radius2, stretch = 1;
  if (d.model == LensModel::fisheye) {
    const double radius = std::sqrt(std::max(radius2, k_least)), angle = std::atan(radius);
    angle2 = angle * angle;
    stretch = angle / radius;
  }
  return stretch * (1 + angle2 * (d.k1 + angle2 * (d.k2 + angle2 * (d.k3 + angle2 * double{d.k4}))));
}

double largest_radius(const Distortion& d) {
  constexpr double k_most = 1e12;  // squared tangent: as good as behind the camera
  constexpr double k_right_angle2 = std::numbers::pi * std::numbers::pi / 4;
  const bool is_fisheye = d.model == LensModel::fisheye;
  // The slope of a point's radius, by the square of its tangent or of its angle.
  const std::vector<double> stops =
      sign_changes({1, 3.0 * d.k1, 5.0 * d.k2, 7.0 * d.k3, 9.0 * d.k4}, is_fisheye ? k_right_angle2 : k_most);
  if (stops.empty()) return std::numeric_limits<double>::infinity();
  const double largest = std::sqrt(stops.front());
  return is_fisheye ? std::tan(largest) : largest;
}

glm::dvec2 distorted(glm::dvec2 tangents, const Distortion& lens, double largest) {
  const double radius = glm::length(tangents);
  if (radius > largest) tangents *= largest / radius;
  const double radius2 = glm::dot(tangents, tangents);
  const glm::dvec2 q(lens.p2, -lens.p1);
  return tangents * (radial_factor(lens, radius2) + 2 * glm::dot(q, tangents)) + q * radius2;
}

glm::dvec2 undistorted(const glm::dvec2& seen, const std::optional<Distortion>& lens) {
  constexpr int k_steps = 8;
  if (!lens) return seen;
  if (lens->model == LensModel::fisheye) return without_fisheye(seen, *lens);
  glm::dvec2 tangents = seen;
  for (int i = 0; i < k_steps; ++i) {
    const double r2 = std::min(glm::dot(tangents, tangents), std::pow(largest_radius(*lens), 2.0));
    tangents = seen / std::max(radial_factor(*lens, r2), 0.1);
  }
  return tangents;
}

std::vector<float> coefficients(const Distortion& d) {
  if (d.model == LensModel::fisheye) return {d.k1, d.k2, d.k3, d.k4};
  return {d.k1, d.k2, d.p1, d.p2, d.k3};
}

}  // namespace dpr
