#include "mesh/adjacency.hpp"

#include <algorithm>
#include <tuple>

namespace dpr {
namespace {

/// A side of a face: the ends of its edge in order, the face, and the corner across.
struct Side {
  std::uint32_t low, high, face, across;
};

std::vector<Side> sorted_sides(const Mesh& mesh) {
  std::vector<Side> sides;
  sides.reserve(3 * mesh.faces.size());
  for (std::size_t face = 0; face < mesh.faces.size(); ++face) {
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t a = mesh.faces[face][i], b = mesh.faces[face][(i + 1) % 3];
      if (a == b) continue;
      sides.push_back(
          {std::min(a, b), std::max(a, b), static_cast<std::uint32_t>(face), mesh.faces[face][(i + 2) % 3]});
    }
  }
  std::ranges::sort(sides, {}, [](const Side& s) { return std::tuple(s.low, s.high, s.face, s.across); });
  return sides;
}

/// Calls visit(first, last) for the sides of every edge.
template <typename Visit>
void for_each_edge(const std::vector<Side>& sides, Visit visit) {
  for (std::size_t first = 0, last = 0; first < sides.size(); first = last) {
    while (last < sides.size() && sides[last].low == sides[first].low &&
           sides[last].high == sides[first].high)
      ++last;
    visit(first, last);
  }
}

}  // namespace

Adjacency make_adjacency(const Mesh& mesh) {
  const std::vector<Side> sides = sorted_sides(mesh);
  Adjacency result;
  result.ring_starts.assign(mesh.positions.size() + 1, 0);
  for_each_edge(sides, [&](std::size_t first, std::size_t last) {
    ++result.ring_starts[sides[first].low + 1];
    ++result.ring_starts[sides[first].high + 1];
    for (std::size_t i = first; i < last; ++i) {
      for (std::size_t k = i + 1; k < last; ++k) {
        if (sides[i].face == sides[k].face) continue;
        result.hinges.push_back({{sides[i].across, sides[k].across}, {sides[first].low, sides[first].high}});
      }
    }
  });
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) result.ring_starts[v + 1] += result.ring_starts[v];
  result.ring.resize(result.ring_starts.back());
  // Edges come in ascending order of the lower end, then of the higher: first each vertex' lower neighbours,
  // then its higher ones.
  std::vector<std::uint32_t> next(result.ring_starts.begin(), result.ring_starts.end() - 1);
  for_each_edge(sides, [&](std::size_t first, std::size_t) {
    result.ring[next[sides[first].high]++] = sides[first].low;
  });
  for_each_edge(sides, [&](std::size_t first, std::size_t) {
    result.ring[next[sides[first].low]++] = sides[first].high;
  });
  return result;
}

}  // namespace dpr
