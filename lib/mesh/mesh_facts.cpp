#include "mesh/mesh_facts.hpp"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <tuple>
#include <utility>

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

/// [vertex] the number of its position among the different ones.
std::vector<std::uint32_t> number_positions(const std::vector<glm::vec3>& positions, std::size_t& count) {
  const auto less = [&](std::uint32_t a, std::uint32_t b) {
    const glm::vec3 &p = positions[a], &q = positions[b];
    return std::tie(p.x, p.y, p.z) < std::tie(q.x, q.y, q.z);
  };
  std::vector<std::uint32_t> order(positions.size()), numbers(positions.size());
  std::iota(order.begin(), order.end(), std::uint32_t{0});
  std::ranges::sort(order, less);
  count = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i > 0 && less(order[i - 1], order[i])) ++count;
    numbers[order[i]] = static_cast<std::uint32_t>(count);
  }
  count += order.empty() ? 0 : 1;
  return numbers;
}

bool has_area(const Mesh& mesh, const glm::uvec3& face) {
  const glm::dvec3 a(mesh.positions[face.x]), b(mesh.positions[face.y]), c(mesh.positions[face.z]);
  return glm::cross(b - a, c - a) != glm::dvec3(0);
}

/// A face's side, from its lower end to its higher one.
struct Side {
  std::uint32_t low, high;                // numbers of positions
  std::uint32_t low_corner, high_corner;  // 3 * face + corner
  bool is_forward;                        // the face goes from the lower end to the higher one
};

bool is_same_edge(const Side& a, const Side& b) { return a.low == b.low && a.high == b.high; }

std::vector<Side> sides_of(const std::vector<glm::uvec3>& faces) {
  std::vector<Side> sides;
  for (std::uint32_t f = 0; f < faces.size(); ++f) {
    const glm::uvec3& face = faces[f];
    if (face.x == face.y || face.y == face.z || face.z == face.x) continue;
    for (int k = 0; k < 3; ++k) {
      const int next = (k + 1) % 3;
      const auto at = [&](int corner) { return 3 * f + static_cast<std::uint32_t>(corner); };
      if (face[k] < face[next]) {
        sides.push_back({face[k], face[next], at(k), at(next), true});
      } else {
        sides.push_back({face[next], face[k], at(next), at(k), false});
      }
    }
  }
  std::ranges::sort(sides, [](const Side& a, const Side& b) {
    return std::tie(a.low, a.high, a.low_corner) < std::tie(b.low, b.high, b.low_corner);
  });
  return sides;
}

/// Counts edges by their faces, and joins the corners of neighbours at either end of an edge.
void look_at_edges(const std::vector<Side>& sides, MeshFacts& facts, DisjointSets& corners) {
  for (auto begin = sides.begin(); begin != sides.end();) {
    const auto end =
        std::find_if(begin, sides.end(), [&](const Side& s) { return !is_same_edge(s, *begin); });
    const auto count = end - begin;
    ++facts.edges;
    if (count == 1) ++facts.boundary_edges;
    if (count == 2 && begin->is_forward == std::next(begin)->is_forward) ++facts.reversed_edges;
    if (count > 2) ++facts.non_manifold_edges;
    for (auto side = begin; side != end; ++side) {
      corners.join(side->low_corner, begin->low_corner);
      corners.join(side->high_corner, begin->high_corner);
    }
    begin = end;
  }
}

void look_at_vertices(const std::vector<Side>& sides, MeshFacts& facts, DisjointSets& corners) {
  std::vector<std::uint8_t> fans(facts.distinct_positions, 0);
  DisjointSets parts(facts.distinct_positions);
  for (const Side& side : sides) parts.join(side.low, side.high);
  std::vector<bool> is_part(facts.distinct_positions);
  for (const Side& side : sides) {
    for (const auto& [position, corner] :
         {std::pair(side.low, side.low_corner), std::pair(side.high, side.high_corner)}) {
      // Each corner is the end of two sides; its fan is counted where it is the fan's root, once.
      const bool is_first_end = side.is_forward == (position == side.low);
      if (is_first_end && corners.root(corner) == corner && fans[position] < 2) ++fans[position];
      if (parts.root(position) == position && !is_part[position]) {
        is_part[position] = true;
        ++facts.components;
      }
    }
  }
  facts.non_manifold_vertices =
      static_cast<std::size_t>(std::ranges::count_if(fans, [](int n) { return n > 1; }));
}

}  // namespace

MeshFacts mesh_facts(const Mesh& mesh) {
  MeshFacts facts;
  const std::vector<std::uint32_t> numbers = number_positions(mesh.positions, facts.distinct_positions);
  std::vector<bool> is_used(mesh.positions.size());
  std::vector<glm::uvec3> faces;
  for (const glm::uvec3& face : mesh.faces) {
    faces.emplace_back(numbers[face.x], numbers[face.y], numbers[face.z]);
    for (int k = 0; k < 3; ++k) is_used[face[k]] = true;
    if (!has_area(mesh, face)) ++facts.faces_without_area;
  }
  facts.unused_vertices = static_cast<std::size_t>(std::ranges::count(is_used, false));
  const std::vector<Side> sides = sides_of(faces);
  DisjointSets corners(3 * faces.size());
  look_at_edges(sides, facts, corners);
  look_at_vertices(sides, facts, corners);
  return facts;
}

}  // namespace dpr
