// The sides of faces, by the edge they lie on.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

namespace dpr {

struct FaceSide {
  std::uint32_t low, high;  ///< the edge's vertices, low < high
  std::uint32_t side;       ///< 3 * face + the corner at which the side begins

  std::uint32_t face() const { return side / 3; }
  int corner() const { return static_cast<int>(side % 3); }
};

/// The sides of all faces, but for those from a vertex to itself: sorted by low, high and side. `vertices` is
/// above every index.
std::vector<FaceSide> sorted_sides(std::span<const glm::uvec3> faces, std::size_t vertices);

/// Calls visit(sides of an edge) for every edge, in order.
template <typename Visit>
void for_each_edge(std::span<const FaceSide> sides, Visit visit) {
  for (std::size_t first = 0, last = 0; first < sides.size(); first = last) {
    while (last < sides.size() && sides[last].low == sides[first].low &&
           sides[last].high == sides[first].high)
      ++last;
    visit(sides.subspan(first, last - first));
  }
}

}  // namespace dpr
