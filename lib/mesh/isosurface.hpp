// Surface of a field that is given on a grid.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "dpr/mesh.hpp"

namespace dpr {

/// Values at the points of a regular grid, positive inside.
struct ScalarGrid {
  glm::ivec3 size{0};  ///< points along each axis
  glm::dvec3 origin{0.0};
  double cell = 1;            ///< distance of neighbours along an axis
  std::vector<float> values;  ///< [z][y][x]

  std::size_t index(const glm::ivec3& point) const {
    return (static_cast<std::size_t>(point.z) * static_cast<std::size_t>(size.y) +
            static_cast<std::size_t>(point.y)) *
               static_cast<std::size_t>(size.x) +
           static_cast<std::size_t>(point.x);
  }
  glm::dvec3 position(const glm::ivec3& point) const { return origin + cell * glm::dvec3(point); }
};

/// The surface on which the values are 0, by marching through the six tetrahedra of every cell (Doi & Koide 1991): a
/// manifold, closed where the values at the grid's border are negative, and wound counter-clockwise as seen from
/// outside. Vertices keep a tenth of an edge's length from the grid's points, so that no triangle is degenerate. There
/// are no faces where no value is positive. Deterministic; O(points).
Mesh isosurface(const ScalarGrid& grid);

}  // namespace dpr
