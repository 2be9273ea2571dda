#include "mesh/face_sides.hpp"

#include <algorithm>
#include <tuple>

namespace dpr {
namespace {

template <typename Visit>
void for_each_side(std::span<const glm::uvec3> faces, Visit visit) {
  for (std::uint32_t face = 0; face < faces.size(); ++face) {
    for (int corner = 0; corner < 3; ++corner) {
      const std::uint32_t a = faces[face][corner], b = faces[face][(corner + 1) % 3];
      if (a != b)
        visit(FaceSide{std::min(a, b), std::max(a, b), 3 * face + static_cast<std::uint32_t>(corner)});
    }
  }
}

}  // namespace

std::vector<FaceSide> sorted_sides(std::span<const glm::uvec3> faces, std::size_t vertices) {
  // Counted by the lower end first: what is left to sort is a vertex's few.
  std::vector<std::uint32_t> starts(vertices + 1, 0);
  for_each_side(faces, [&](const FaceSide& s) { ++starts[s.low + 1]; });
  for (std::size_t v = 0; v < vertices; ++v) starts[v + 1] += starts[v];
  std::vector<FaceSide> sides(starts.back());
  std::vector<std::uint32_t> next(starts.begin(), starts.end() - 1);
  for_each_side(faces, [&](const FaceSide& s) { sides[next[s.low]++] = s; });
  for (std::size_t v = 0; v < vertices; ++v) {
    std::sort(sides.begin() + starts[v], sides.begin() + starts[v + 1],
              [](const FaceSide& a, const FaceSide& b) {
                return std::tie(a.high, a.side) < std::tie(b.high, b.side);
              });
  }
  return sides;
}

}  // namespace dpr
