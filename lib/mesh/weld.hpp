// Vertices at the same position.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "dpr/mesh.hpp"

namespace dpr {

/// [vertex] the first vertex at the same position, itself where there is no earlier one.
std::vector<std::uint32_t> weld(std::span<const glm::vec3> positions);

/// The faces between these vertices instead.
std::vector<glm::uvec3> weld(std::span<const glm::uvec3> faces, std::span<const std::uint32_t> first);

/// Makes one vertex of those at the same position, the first; the order stays. The mesh has no colours of
/// vertices.
void weld(Mesh& mesh);

}  // namespace dpr
