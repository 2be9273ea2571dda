// Whether a mesh bounds a solid, and on which side of its faces that lies.
#pragma once

#include <span>

#include "mesh/welded_edges.hpp"

namespace dpr {

/// The parts of a mesh that are closed and wound alike.
class Solid {
 public:
  Solid() = default;
  /// `edges` are those of the faces: make_welded_edges().
  Solid(std::span<const WeldedEdge> edges, std::size_t faces);

  /// Whether all faces belong to such parts.
  bool is_closed() const { return is_closed_; }
  /// Whether that rests on indices alone, not on vertices that coincide and may be moved apart.
  bool is_closed_by_indices() const { return is_closed_by_indices_; }
  /// +1 where the faces of all parts wind counter-clockwise as seen from outside, -1 clockwise: the sign of
  /// the parts' volumes. 0 where they differ, or one is not closed or not finite.
  int winding(std::span<const glm::vec3> positions, std::span<const glm::uvec3> faces) const;

 private:
  bool is_closed_ = false, is_closed_by_indices_ = false;
  std::size_t parts_ = 0;
  std::vector<std::uint32_t> part_of_face_;
};

}  // namespace dpr
