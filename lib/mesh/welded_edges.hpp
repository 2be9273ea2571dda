// The edges of a mesh, with the faces that meet there: by the vertices that faces share and, where a face is
// alone with its vertices, by where those lie.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <vector>

namespace dpr {

/// An edge of a face, on the face's own vertices and in its direction, and the one other face at it.
struct WeldedEdge {
  std::uint32_t first, second;  ///< vertices
  std::uint32_t face;
  std::uint8_t corner;  ///< of the face: where it begins
  std::optional<std::uint32_t> other;
  bool same_direction = false;   ///< the other face goes through it from first to second too
  bool shares_vertices = false;  ///< the other face has both vertices themselves
  bool is_open = false;          ///< no other face has both: whether one lies there depends on positions
};

/// The edges by vertices alone, in the order of these. Two faces that share an edge's vertices have it
/// together, once. Where a face is alone, or three or more meet, each has one without another face. Faces
/// that repeat a vertex have none. `vertices` is above every index; O(faces).
std::vector<WeldedEdge> make_edges(std::span<const glm::uvec3> faces, std::size_t vertices);

/// Joins two open edges that lie in one place, and no third there: each names the other's face. Those of
/// faces that have two corners in one place stay alone. kernels/edges.cl does the same. O(n log n) of the
/// open edges.
void join_open(std::span<const glm::vec3> positions, std::span<const glm::uvec3> faces,
               std::span<WeldedEdge> edges);

}  // namespace dpr
