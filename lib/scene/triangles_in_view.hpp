// Triangles that a scene's camera does not show, and why.
#pragma once

#include <cstddef>

#include "dpr/scene.hpp"

namespace dpr {

/// Numbers of triangles, each counted for the first reason that holds.
struct TrianglesInView {
  std::size_t without_area = 0;
  std::size_t near = 0;     ///< wholly nearer than znear
  std::size_t far = 0;      ///< wholly beyond zfar
  std::size_t outside = 0;  ///< wholly to one side of the image; not counted of a lens' images
  std::size_t clipped = 0;  ///< at znear; their rest is drawn

  std::size_t not_shown() const { return without_area + near + far + outside; }
};

/// Counts the triangles of the mesh at an entry of Scene::meshes.
TrianglesInView triangles_in_view(const Scene& scene, std::size_t entry);

}  // namespace dpr
