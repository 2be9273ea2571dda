// The edges of a soup of triangles, with the faces that meet there: by position, whatever the vertices'
// indices.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <vector>

namespace dpr {

/// An edge of a face, on the face's own vertices and in its direction, and the one other face that has an
/// edge at the same place.
struct WeldedEdge {
  std::uint32_t first, second;  ///< vertices
  std::uint32_t face;
  std::uint8_t corner;  ///< of the face: where it begins
  std::optional<std::uint32_t> other;
  bool same_direction = false;   ///< the other face goes through it from first to second too
  bool shares_vertices = false;  ///< the other face has both vertices themselves
};

/// Two faces that share an edge's vertices have it together, once; where their vertices only coincide, each
/// has one of its own that names the other. Where a face is alone, or three or more meet, each has one
/// without another face. Sides between coinciding corners are no edges. In the order of the vertices;
/// O(faces).
std::vector<WeldedEdge> make_welded_edges(std::span<const glm::vec3> positions,
                                          std::span<const glm::uvec3> faces);

}  // namespace dpr
