#include "mesh/mesh_facts.hpp"

#include <algorithm>
#include <cstdint>
#include <functional>
#include <numeric>

#include "mesh/face_sides.hpp"
#include "mesh/weld.hpp"

namespace dpr {
namespace {

/// Sets that are joined step by step.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), std::uint32_t{0});
  }

  std::uint32_t root(std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::uint32_t a, std::uint32_t b) { parent_[root(a)] = root(b); }

 private:
  std::vector<std::uint32_t> parent_;
};

bool has_three_corners(const glm::uvec3& face) {
  return face.x != face.y && face.y != face.z && face.z != face.x;
}

/// Faces on distinct vertices, and their sides. A corner is 3 * face + its number.
struct Sides {
  std::vector<glm::uvec3> faces;
  std::vector<FaceSide> list;

  bool is_forward(const FaceSide& s) const { return faces[s.face()][s.corner()] == s.low; }
  std::uint32_t next_corner(const FaceSide& s) const { return s.corner() == 2 ? s.side - 2 : s.side + 1; }
  std::uint32_t low_corner(const FaceSide& s) const { return is_forward(s) ? s.side : next_corner(s); }
  std::uint32_t high_corner(const FaceSide& s) const { return is_forward(s) ? next_corner(s) : s.side; }
};

/// Counts edges by their faces, and joins the corners of neighbours at either end of an edge.
void look_at_edges(const Sides& sides, MeshFacts& facts, DisjointSets& corners) {
  for_each_edge(sides.list, [&](std::span<const FaceSide> edge) {
    ++facts.edges;
    if (edge.size() == 1) ++facts.boundary_edges;
    if (edge.size() == 2 && sides.is_forward(edge[0]) == sides.is_forward(edge[1])) ++facts.reversed_edges;
    if (edge.size() > 2) ++facts.non_manifold_edges;
    for (const FaceSide& side : edge) {
      corners.join(sides.low_corner(side), sides.low_corner(edge[0]));
      corners.join(sides.high_corner(side), sides.high_corner(edge[0]));
    }
  });
}

void look_at_vertices(const Sides& sides, std::size_t vertices, MeshFacts& facts, DisjointSets& corners) {
  std::vector<std::uint8_t> fans(vertices, 0);
  for (const FaceSide& side : sides.list) {
    // Each corner begins one side; its fan is counted where it is the fan's root, once.
    const std::uint32_t vertex = sides.faces[side.face()][side.corner()];
    if (corners.root(side.side) == side.side && fans[vertex] < 2) ++fans[vertex];
  }
  facts.non_manifold_vertices =
      static_cast<std::size_t>(std::ranges::count_if(fans, [](int n) { return n > 1; }));
}

/// Parts that share no position and are seen, for one of their faces has an area.
std::size_t count_components(const Mesh& mesh, const std::vector<glm::uvec3>& faces) {
  DisjointSets parts(mesh.positions.size());
  for (const glm::uvec3& face : faces) {
    parts.join(face.x, face.y);
    parts.join(face.x, face.z);
  }
  std::vector<bool> is_part(mesh.positions.size());
  for (const glm::uvec3& face : faces) {
    if (has_area(mesh, face)) is_part[parts.root(face.x)] = true;
  }
  return static_cast<std::size_t>(std::ranges::count(is_part, true));
}

}  // namespace

bool has_area(const Mesh& mesh, const glm::uvec3& face) {
  const glm::dvec3 a(mesh.positions[face.x]), b(mesh.positions[face.y]), c(mesh.positions[face.z]);
  return glm::cross(b - a, c - a) != glm::dvec3(0);
}

MeshFacts mesh_facts(const Mesh& mesh) {
  MeshFacts facts;
  const std::vector<std::uint32_t> first = weld(mesh.positions);
  for (std::uint32_t v = 0; v < first.size(); ++v) facts.distinct_positions += first[v] == v ? 1 : 0;
  std::vector<bool> is_used(mesh.positions.size());
  for (const glm::uvec3& face : mesh.faces) {
    for (int k = 0; k < 3; ++k) is_used[face[k]] = true;
    if (!has_area(mesh, face)) ++facts.faces_without_area;
  }
  facts.unused_vertices = static_cast<std::size_t>(std::ranges::count(is_used, false));
  Sides sides{weld(mesh.faces, first), {}};
  std::erase_if(sides.faces, std::not_fn(has_three_corners));
  sides.list = sorted_sides(sides.faces, first.size());
  DisjointSets corners(3 * sides.faces.size());
  look_at_edges(sides, facts, corners);
  look_at_vertices(sides, first.size(), facts, corners);
  facts.components = count_components(mesh, sides.faces);
  return facts;
}

}  // namespace dpr
