// A cube whose sides share its corners.
#pragma once

#include <algorithm>

#include "dpr/mesh.hpp"
#include "pipeline/scenes.hpp"

namespace dpr::test {

/// On eight vertices, so that no move tears it. Each triangle has a colour of its own, so that all edges are
/// contours.
inline Mesh welded_cube() {
  pipeline::Random random(3);
  const Mesh cube = make_cube();
  Mesh mesh;
  for (const glm::uvec3& face : cube.faces) {
    glm::uvec3 welded;
    for (int i = 0; i < 3; ++i) {
      const glm::vec3 corner = cube.positions[face[i]];
      const auto found = std::ranges::find(mesh.positions, corner);
      welded[i] = static_cast<unsigned>(found - mesh.positions.begin());
      if (found == mesh.positions.end()) mesh.positions.push_back(corner);
    }
    mesh.faces.push_back(welded);
    mesh.face_colors.push_back(random.vector(0, 1));
  }
  return mesh;
}

}  // namespace dpr::test
