// Rotations spread evenly over all rotations.
#pragma once

#include <cstddef>
#include <glm/glm.hpp>
#include <vector>

namespace dpr {

/// `count` rotations, any number: super-Fibonacci spirals, Alexa 2022, Super-Fibonacci Spirals: Fast,
/// Low-Discrepancy Sampling of SO(3). Without randomness.
std::vector<glm::dmat3> rotation_grid(std::size_t count);

}  // namespace dpr
