// Test of whether a mesh bounds a solid, and of the side of its faces on which the solid lies.
#pragma once

#include <span>

#include "mesh/welded_edges.hpp"

namespace dpr {

/// The parts of a mesh that are closed and wound alike.
class Solid {
 public:
  Solid() = default;
  /// `edges` are those of the first so many faces: make_edges(). Others have no part in it.
  Solid(std::span<const WeldedEdge> edges, std::size_t faces);

  /// +1 where the faces of all parts wind counter-clockwise as seen from outside, -1 clockwise: the sign of
  /// the parts' volumes. 0 where they differ, or one is not closed or not finite. A part of faces with
  /// vertices of their own is closed where those coincide. O(faces).
  int winding(std::span<const glm::vec3> positions, std::span<const glm::uvec3> faces) const;
  /// True for faces that are one closed part wherever the vertices lie: then winding() is the sign of the volume.
  bool is_one_part() const { return may_be_closed_ && open_edges_.empty() && patches_ == 1; }

 private:
  bool may_be_closed_ = false;
  std::size_t faces_ = 0;
  std::vector<WeldedEdge> open_edges_;
  std::vector<std::uint32_t> patch_of_face_;  // joined by vertices; empty where all are one
  std::uint32_t patches_ = 0;
};

}  // namespace dpr
