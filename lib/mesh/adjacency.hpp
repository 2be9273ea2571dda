// Who is whose neighbour in a soup of triangles.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "dpr/mesh.hpp"

namespace dpr {

/// Two faces at an edge.
struct Hinge {
  std::array<std::uint32_t, 2> across;  ///< the corner of each face that is not on the edge
  std::array<std::uint32_t, 2> edge;    ///< its ends, the lower index first
};

/// Neighbourhoods of a mesh of any kind. On manifold ones the rings are OpenMesh's; it takes no others.
struct Adjacency {
  std::vector<std::uint32_t> ring_starts;  ///< [vertex + 1]
  std::vector<std::uint32_t> ring;         ///< one-rings, each ascending: every edge in both directions
  std::vector<Hinge> hinges;               ///< every two faces at an edge, in order of edges, then of faces

  std::size_t edges() const { return ring.size() / 2; }
};

/// Sides between equal corners are no edges. O(faces log faces) for manifold meshes.
Adjacency make_adjacency(const Mesh& mesh);

}  // namespace dpr
