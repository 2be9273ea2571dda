// Newton's iteration towards the nearest orthogonal matrix.
#include "solve/polar.hpp"

#include <cmath>

namespace dpr {
namespace {

double squared_norm(const glm::dmat3& m) {
  return glm::dot(m[0], m[0]) + glm::dot(m[1], m[1]) + glm::dot(m[2], m[2]);
}

}  // namespace

Polar polar_decomposition(const glm::dmat3& matrix) {
  // Convergence is quadratic once near; scaling to |det| = 1 brings any invertible matrix near within a few
  // steps.
  constexpr int k_iterations = 100;
  constexpr double k_tolerance = 1e-28;  // of the squared step; the squared norm is 3
  glm::dmat3 rotation = matrix;
  for (int i = 0; i < k_iterations; ++i) {
    const double scale = 1 / std::cbrt(std::abs(glm::determinant(rotation)));
    const glm::dmat3 scaled = scale * rotation;
    const glm::dmat3 next = 0.5 * (scaled + glm::inverse(glm::transpose(scaled)));
    const double change = squared_norm(next - rotation);
    rotation = next;
    if (change < k_tolerance) break;
  }
  if (glm::determinant(rotation) < 0) rotation = -rotation;
  const glm::dmat3 stretch = glm::transpose(rotation) * matrix;
  return {rotation, 0.5 * (stretch + glm::transpose(stretch))};
}

glm::mat4 affine(const glm::dmat3& linear, const glm::dvec3& translation) {
  glm::dmat4 matrix(linear);
  matrix[3] = glm::dvec4(translation, 1.0);
  return glm::mat4(matrix);
}

}  // namespace dpr
