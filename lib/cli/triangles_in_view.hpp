// Triangles that a scene's camera does not show, and why.
#pragma once

#include <cstddef>
#include <string>

#include "dpr/scene.hpp"

namespace dpr::cli {

/// Numbers of triangles, each counted for the first reason that holds.
struct TrianglesInView {
  std::size_t without_area = 0;
  std::size_t near = 0;     ///< wholly nearer than znear
  std::size_t far = 0;      ///< wholly beyond zfar
  std::size_t outside = 0;  ///< wholly to one side of the image; not counted of a lens' images
  std::size_t clipped = 0;  ///< at znear; their rest is drawn
};

/// Counts the triangles of the mesh at an entry of Scene::meshes.
TrianglesInView triangles_in_view(const Scene& scene, std::size_t entry);

/// "1 triangle", "2 triangles".
std::string counted(std::size_t count, const std::string& what);

}  // namespace dpr::cli
