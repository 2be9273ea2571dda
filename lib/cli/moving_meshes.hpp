// Meshes of a scene that dpr pose moves.
#pragma once

#include <string>
#include <vector>

#include "dpr/pose.hpp"
#include "dpr/scene.hpp"

namespace dpr::cli {

/// The numbers of each --mesh, separated by commas; one empty list where none is given, which stands for the scene's
/// only mesh. Throws InvalidArgument for what is no mesh of the scene, for a mesh that is named twice, and where none
/// is given in a scene of several meshes.
PoseBodies parse_moving_meshes(const std::vector<std::string>& texts, const Scene& scene);

}  // namespace dpr::cli
