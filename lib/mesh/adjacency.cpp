#include "mesh/adjacency.hpp"

#include "mesh/face_sides.hpp"

namespace dpr {
Adjacency make_adjacency(const Mesh& mesh) {
  const std::vector<FaceSide> sides = sorted_sides(mesh.faces, mesh.positions.size());
  const auto across = [&](const FaceSide& s) { return mesh.faces[s.face()][(s.corner() + 2) % 3]; };
  Adjacency result;
  result.ring_starts.assign(mesh.positions.size() + 1, 0);
  for_each_edge(sides, [&](std::span<const FaceSide> edge) {
    const auto [low, high, side] = edge.front();
    ++result.ring_starts[low + 1];
    ++result.ring_starts[high + 1];
    for (std::size_t i = 0; i < edge.size(); ++i) {
      for (std::size_t k = i + 1; k < edge.size(); ++k) {
        if (edge[i].face() != edge[k].face())
          result.hinges.push_back({{across(edge[i]), across(edge[k])}, {low, high}});
      }
    }
  });
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) result.ring_starts[v + 1] += result.ring_starts[v];
  result.ring.resize(result.ring_starts.back());
  // Edges come in ascending order of the lower end, then of the higher: first each vertex' lower neighbours,
  // then its higher ones.
  std::vector<std::uint32_t> next(result.ring_starts.begin(), result.ring_starts.end() - 1);
  for_each_edge(sides, [&](std::span<const FaceSide> edge) {
    result.ring[next[edge.front().high]++] = edge.front().low;
  });
  for_each_edge(sides, [&](std::span<const FaceSide> edge) {
    result.ring[next[edge.front().low]++] = edge.front().high;
  });
  return result;
}

}  // namespace dpr
