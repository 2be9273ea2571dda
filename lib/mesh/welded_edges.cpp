#include "mesh/welded_edges.hpp"

#include "mesh/face_sides.hpp"
#include "mesh/weld.hpp"

namespace dpr {
namespace {

WeldedEdge lone_edge(std::span<const glm::uvec3> faces, const FaceSide& side) {
  const glm::uvec3& face = faces[side.face()];
  return {.first = face[side.corner()],
          .second = face[(side.corner() + 1) % 3],
          .face = side.face(),
          .corner = static_cast<std::uint8_t>(side.corner()),
          .other = {}};
}

void add_pair(std::span<const glm::uvec3> faces, const std::vector<std::uint32_t>& welded,
              const FaceSide& own_side, const FaceSide& other_side, std::vector<WeldedEdge>& edges) {
  WeldedEdge own = lone_edge(faces, own_side), other = lone_edge(faces, other_side);
  own.other = other.face;
  other.other = own.face;
  own.same_direction = other.same_direction = welded[own.first] == welded[other.first];
  own.shares_vertices = own.same_direction ? own.first == other.first && own.second == other.second
                                           : own.first == other.second && own.second == other.first;
  edges.push_back(own);
  if (!own.shares_vertices) edges.push_back(other);
}

}  // namespace

std::vector<WeldedEdge> make_welded_edges(std::span<const glm::vec3> positions,
                                          std::span<const glm::uvec3> faces) {
  const std::vector<std::uint32_t> first = weld(positions);
  std::vector<WeldedEdge> edges;
  edges.reserve(faces.size() * 3 / 2);
  for_each_edge(sorted_sides(weld(faces, first), positions.size()), [&](std::span<const FaceSide> sides) {
    if (sides.size() == 2 && sides[0].face() != sides[1].face()) {
      add_pair(faces, first, sides[0], sides[1], edges);
    } else {
      for (const FaceSide& side : sides) edges.push_back(lone_edge(faces, side));
    }
  });
  return edges;
}

}  // namespace dpr
