// The solid that a mesh bounds, on a regular grid: for comparing shapes by their volume.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "dpr/export.h"
#include "dpr/mesh.hpp"
#include "dpr/vectors.hpp"

namespace dpr {

/// An axis-aligned box, object space.
struct Bounds {
  vec3 low{-1.0F}, high{1.0F};
};

/// Points that a surface encloses. nonzero: its winding number is not 0, so that overlapping parts are one
/// solid and inverted ones count; for consistently oriented faces. even_odd: a ray to it crosses the surface
/// an odd number of times; for faces of any orientation.
enum class FillRule { nonzero, even_odd };

/// resolution^3 equal cells of a box; a cell is occupied if its centre is inside.
struct DPR_API VoxelGrid {
  unsigned resolution = 0;
  Bounds bounds;
  std::vector<std::uint8_t> cells;  ///< [z][y][x], 1 inside, 0 outside

  std::size_t index(unsigned x, unsigned y, unsigned z) const {
    return (std::size_t{z} * resolution + y) * resolution + x;
  }
  bool occupied(unsigned x, unsigned y, unsigned z) const { return cells[index(x, y, z)] != 0; }
  /// Number of occupied cells.
  std::size_t count() const;
};

/// The cells whose centres the mesh encloses, by rays along each axis; where holes or non-manifold parts make
/// the three disagree, the majority decides. Rays through edges and vertices are counted once (they are
/// displaced symbolically, Edelsbrunner & Muecke 1990). Parts outside the box count as they should. Throws
/// InvalidArgument for a mesh that is not valid, a resolution outside 1 to 512, bounds that are not finite
/// or empty. O(faces + cells + columns of cells under each face), on the host; serial and deterministic.
DPR_API VoxelGrid voxelize(const Mesh& mesh, unsigned resolution, const Bounds& bounds,
                           FillRule rule = FillRule::nonzero);

/// Occupied cells of both over those of either; 1 where both are empty. Throws InvalidArgument if the grids
/// differ in resolution or bounds.
DPR_API double iou(const VoxelGrid& a, const VoxelGrid& b);

}  // namespace dpr
