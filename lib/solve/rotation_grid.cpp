// Rotations on super-Fibonacci spirals.
#include "solve/rotation_grid.hpp"

#include <cmath>
#include <glm/gtc/constants.hpp>
#include <glm/gtc/quaternion.hpp>

namespace dpr {

std::vector<glm::dmat3> rotation_grid(std::size_t count) {
  // The two ratios of the paper: sqrt(2), and the positive root of x^4 = x + 4.
  const double phi = std::sqrt(2.0);
  constexpr double k_psi = 1.533751168755204288118041;
  std::vector<glm::dmat3> grid;
  grid.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double s = static_cast<double>(i) + 0.5, height = s / static_cast<double>(count);
    const double a = glm::two_pi<double>() * s / phi, b = glm::two_pi<double>() * s / k_psi;
    const double inner = std::sqrt(height), outer = std::sqrt(1 - height);
    grid.push_back(glm::mat3_cast(
        glm::dquat(outer * std::cos(b), inner * std::sin(a), inner * std::cos(a), outer * std::sin(b))));
  }
  return grid;
}

}  // namespace dpr
