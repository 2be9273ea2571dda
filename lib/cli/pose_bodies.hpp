// Which of a scene's meshes dpr pose moves.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "dpr/scene.hpp"

namespace dpr::cli {

/// Meshes that move together, of each --mesh; without any the scene's only mesh. Throws InvalidArgument for what is no
/// mesh of the scene, for a mesh that is named twice, and for a scene of several meshes without --mesh.
std::vector<std::vector<std::size_t>> parse_bodies(const std::vector<std::string>& texts, const Scene& scene);

}  // namespace dpr::cli
