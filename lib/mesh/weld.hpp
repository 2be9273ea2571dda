// Vertices at the same position.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

namespace dpr {

/// [vertex] the first vertex at the same position, itself where there is no earlier one.
std::vector<std::uint32_t> weld(std::span<const glm::vec3> positions);

/// The faces between these vertices instead.
std::vector<glm::uvec3> weld(std::span<const glm::uvec3> faces, std::span<const std::uint32_t> first);

}  // namespace dpr
