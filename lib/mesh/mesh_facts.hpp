// Topology of a mesh's surface.
#pragma once

#include <cstddef>

#include "dpr/mesh.hpp"

namespace dpr {

/// Facts of the surface. Vertices at equal positions count as one, and triangles with two equal corners are
/// left out, so that seams of colours, normals and texture coordinates do not cut the surface.
struct MeshFacts {
  std::size_t distinct_positions = 0;
  std::size_t unused_vertices = 0;     ///< that no face refers to
  std::size_t faces_without_area = 0;  ///< exactly zero, equal corners among them
  std::size_t components = 0;          ///< parts that share no position; with faces that have an area
  std::size_t edges = 0;
  std::size_t boundary_edges = 0;         ///< of one face
  std::size_t non_manifold_edges = 0;     ///< of more than two faces
  std::size_t non_manifold_vertices = 0;  ///< whose faces are more than one fan
  std::size_t reversed_edges = 0;         ///< of two faces that are wound in opposite senses

  bool is_manifold() const { return non_manifold_edges == 0 && non_manifold_vertices == 0; }
  bool is_closed() const { return edges > 0 && boundary_edges == 0; }
  bool is_oriented() const { return reversed_edges == 0; }
};

/// False for a face whose area is exactly zero.
bool has_area(const Mesh& mesh, const glm::uvec3& face);

/// Computes the facts of a valid mesh in O(n log n).
MeshFacts mesh_facts(const Mesh& mesh);

}  // namespace dpr
