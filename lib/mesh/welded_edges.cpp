#include "mesh/welded_edges.hpp"

#include <algorithm>
#include <tuple>

#include "mesh/face_sides.hpp"
#include "mesh/weld.hpp"

namespace dpr {
namespace {

template <class Corner>
bool has_repeated(const Corner& a, const Corner& b, const Corner& c) {
  return a == b || b == c || c == a;
}

WeldedEdge lone_edge(std::span<const glm::uvec3> faces, const FaceSide& side) {
  const glm::uvec3& face = faces[side.face()];
  return {.first = face[side.corner()],
          .second = face[(side.corner() + 1) % 3],
          .face = side.face(),
          .corner = static_cast<std::uint8_t>(side.corner()),
          .other = {}};
}

/// An open edge by the places of its ends, in order.
struct PlacedEdge {
  std::uint32_t low, high, edge;
};

}  // namespace

std::vector<WeldedEdge> make_edges(std::span<const glm::uvec3> faces, std::size_t vertices) {
  std::vector<FaceSide> all = sorted_sides(faces, vertices);
  std::erase_if(all, [&](const FaceSide& side) {
    const glm::uvec3& face = faces[side.face()];
    return has_repeated(face.x, face.y, face.z);
  });
  std::vector<WeldedEdge> edges;
  edges.reserve(faces.size() * 3 / 2);
  for_each_edge(all, [&](std::span<const FaceSide> sides) {
    if (sides.size() == 2) {
      WeldedEdge& edge = edges.emplace_back(lone_edge(faces, sides[0]));
      edge.other = sides[1].face();
      edge.same_direction = lone_edge(faces, sides[1]).first == edge.first;
      edge.shares_vertices = true;
      return;
    }
    for (const FaceSide& side : sides) edges.push_back(lone_edge(faces, side));
    edges.back().is_open = sides.size() == 1;
  });
  return edges;
}

void join_open(std::span<const glm::vec3> positions, std::span<const glm::uvec3> faces,
               std::span<WeldedEdge> edges) {
  std::vector<std::uint32_t> open;
  std::vector<glm::vec3> ends;
  for (std::uint32_t e = 0; e < edges.size(); ++e) {
    const glm::uvec3& face = faces[edges[e].face];
    if (!edges[e].is_open || has_repeated(positions[face.x], positions[face.y], positions[face.z])) continue;
    open.push_back(e);
    ends.insert(ends.end(), {positions[edges[e].first], positions[edges[e].second]});
  }
  const std::vector<std::uint32_t> place = weld(ends);
  std::vector<PlacedEdge> placed;
  placed.reserve(open.size());
  for (std::uint32_t i = 0; i < open.size(); ++i) {
    const auto [low, high] = std::minmax(place[2 * i], place[2 * i + 1]);
    placed.push_back({low, high, i});
  }
  const auto key = [](const PlacedEdge& edge) { return std::tie(edge.low, edge.high); };
  std::ranges::sort(placed, {},
                    [](const PlacedEdge& edge) { return std::tie(edge.low, edge.high, edge.edge); });
  for (auto first = placed.begin(), last = first; first != placed.end(); first = last) {
    while (last != placed.end() && key(*last) == key(*first)) ++last;
    if (last - first != 2) continue;
    WeldedEdge &a = edges[open[first[0].edge]], &b = edges[open[first[1].edge]];
    a.other = b.face;
    b.other = a.face;
    a.same_direction = b.same_direction = place[2 * first[0].edge] == place[2 * first[1].edge];
  }
}

}  // namespace dpr
