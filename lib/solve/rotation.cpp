// Rotations: exponential map, logarithm, angle between two.
#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>

#include "dpr/pose.hpp"

namespace dpr {

glm::dmat3 rotation_from_vector(glm::dvec3 r) {
  // Half angles and sin(x)/x have no cancellation near 0, where the axis is not defined.
  const double half_angle = glm::length(r) / 2;
  const double half_sinc = half_angle < 1e-8 ? 0.5 : std::sin(half_angle) / (2 * half_angle);
  return glm::mat3_cast(glm::dquat(std::cos(half_angle), r * half_sinc));
}

glm::dvec3 vector_from_rotation(const glm::dmat3& rotation) {
  // The quaternion is computed from its largest component, so that neither 0 nor pi loses digits. Its sign is
  // chosen for an angle of at most pi.
  glm::dquat q = glm::quat_cast(rotation);
  if (q.w < 0) q = -q;
  const glm::dvec3 axis(q.x, q.y, q.z);
  const double sine = glm::length(axis);
  if (sine < 1e-150) return 2.0 * axis;
  return axis * (2 * std::atan2(sine, q.w) / sine);
}

double angle_degrees(const glm::dmat3& a, const glm::dmat3& b) {
  const double angle = glm::length(vector_from_rotation(glm::transpose(a) * b));
  return std::min(glm::degrees(angle), 180.0);
}

}  // namespace dpr
