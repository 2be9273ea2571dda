// Parts of a mesh that bound a solid, and the side of their faces on which it lies.
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

  /// True if all faces belong to such parts.
  bool is_closed() const { return is_closed_; }
  /// True if they still do after vertices have moved: coincident ones may have parted.
  bool is_closed_at(std::span<const glm::vec3> positions, std::span<const glm::uvec3> faces) const;
  /// +1 where the faces of all parts wind counter-clockwise as seen from outside, -1 clockwise: the sign of
  /// the parts' volumes. 0 where they differ, or one is not closed or not finite.
  int winding(std::span<const glm::vec3> positions, std::span<const glm::uvec3> faces) const;

 private:
  bool is_closed_ = false;
  std::vector<WeldedEdge> split_edges_;  // whose faces have vertices of their own there
  std::size_t parts_ = 0;
  std::vector<std::uint32_t> part_of_face_;  // empty where there is one part
};

}  // namespace dpr
