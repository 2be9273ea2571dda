// Meshes of a scene that dpr pose moves.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "dpr/scene.hpp"

namespace dpr::cli {

/// The numbers of --mesh, separated by commas; none for an empty text, which stands for the scene's only mesh. Throws
/// InvalidArgument for what is no mesh of the scene, for a mesh that is named twice, and for an empty text where there
/// are several meshes.
std::vector<std::size_t> parse_moving_meshes(const std::string& text, const Scene& scene);

}  // namespace dpr::cli
