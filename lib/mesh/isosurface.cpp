// Marching tetrahedra: a cell's six tetrahedra lie about its diagonal, so that those of neighbours share their edges.
#include "mesh/isosurface.hpp"

#include <algorithm>
#include <array>
#include <unordered_map>

namespace dpr {
namespace {

using Tetrahedron = std::array<glm::ivec3, 4>;  // corners in the unit cell, along a path of its edges
using Edge = std::array<int, 2>;                // corners of a tetrahedron
using Triangle = std::array<Edge, 3>;

std::array<Tetrahedron, 6> make_tetrahedra() {
  std::array<Tetrahedron, 6> list;
  std::array<int, 3> axes{0, 1, 2};
  for (Tetrahedron& tetrahedron : list) {
    tetrahedron[0] = glm::ivec3(0);
    for (std::size_t i = 0; i < 3; ++i) {
      tetrahedron[i + 1] = tetrahedron[i];
      tetrahedron[i + 1][axes[i]] = 1;
    }
    std::ranges::next_permutation(axes);
  }
  return list;
}

/// The triangle, or its reverse, whose normal points from the corners inside to those outside; `mask` has a bit for
/// every corner inside.
Triangle facing_out(const Tetrahedron& corners, unsigned mask, Triangle triangle) {
  const auto middle = [&](const Edge& edge) {
    return 0.5 * glm::dvec3(corners[static_cast<std::size_t>(edge[0])] +
                            corners[static_cast<std::size_t>(edge[1])]);
  };
  const glm::dvec3 a = middle(triangle[0]), b = middle(triangle[1]), c = middle(triangle[2]);
  const bool first_is_inside = (mask >> triangle[0][0] & 1U) != 0;
  const std::size_t inside = static_cast<std::size_t>(triangle[0][first_is_inside ? 0 : 1]);
  const std::size_t outside = static_cast<std::size_t>(triangle[0][first_is_inside ? 1 : 0]);
  const glm::dvec3 outwards(corners[outside] - corners[inside]);
  if (glm::dot(glm::cross(b - a, c - a), outwards) < 0) std::swap(triangle[1], triangle[2]);
  return triangle;
}

/// Triangles of a tetrahedron, by the corners that are inside.
std::array<std::vector<Triangle>, 16> make_triangles(const Tetrahedron& corners) {
  std::array<std::vector<Triangle>, 16> by_mask;
  for (unsigned mask = 1; mask < 15; ++mask) {
    std::vector<int> inside, outside;
    for (int i = 0; i < 4; ++i) ((mask >> i & 1U) != 0 ? inside : outside).push_back(i);
    const auto edge = [](int a, int b) { return Edge{std::min(a, b), std::max(a, b)}; };
    std::vector<Edge> around;  // edges that the surface crosses, in turn
    if (inside.size() == 2) {
      around = {edge(inside[0], outside[0]), edge(inside[0], outside[1]), edge(inside[1], outside[1]),
                edge(inside[1], outside[0])};
    } else {
      const bool one_inside = inside.size() == 1;
      const int apex = one_inside ? inside[0] : outside[0];
      for (const int other : one_inside ? outside : inside) around.push_back(edge(apex, other));
    }
    for (std::size_t i = 2; i < around.size(); ++i)
      by_mask[mask].push_back(facing_out(corners, mask, {around[0], around[i - 1], around[i]}));
  }
  return by_mask;
}

/// Vertices on the grid's edges, made where they are first asked for.
class EdgeVertices {
 public:
  EdgeVertices(const ScalarGrid& grid, std::vector<glm::vec3>& positions)
      : grid_(grid), positions_(positions) {}

  /// On the edge from one point to another whose coordinates are the same or larger by 1.
  unsigned find(const glm::ivec3& from, const glm::ivec3& to) {
    constexpr float k_margin = 0.1F;
    const glm::ivec3 step = to - from;
    const std::size_t direction = static_cast<std::size_t>(step.x + 2 * step.y + 4 * step.z);
    const auto [found, is_new] =
        numbers_.try_emplace(8 * grid_.index(from) + direction, static_cast<unsigned>(positions_.size()));
    if (is_new) {
      const float a = grid_.values[grid_.index(from)], b = grid_.values[grid_.index(to)];
      const double part = std::clamp(a / (a - b), k_margin, 1 - k_margin);
      positions_.emplace_back(glm::mix(grid_.position(from), grid_.position(to), part));
    }
    return found->second;
  }

 private:
  const ScalarGrid& grid_;
  std::vector<glm::vec3>& positions_;
  std::unordered_map<std::size_t, unsigned> numbers_;  // by the edge's first point and direction
};

}  // namespace

Mesh isosurface(const ScalarGrid& grid) {
  const std::array<Tetrahedron, 6> tetrahedra = make_tetrahedra();
  std::array<std::array<std::vector<Triangle>, 16>, 6> triangles;
  std::ranges::transform(tetrahedra, triangles.begin(), make_triangles);
  Mesh mesh;
  EdgeVertices vertices(grid, mesh.positions);
  const auto is_inside = [&](const glm::ivec3& point) { return grid.values[grid.index(point)] > 0; };
  const auto march = [&](const glm::ivec3& cell) {
    for (std::size_t t = 0; t < tetrahedra.size(); ++t) {
      unsigned mask = 0;
      for (unsigned i = 0; i < 4; ++i) mask |= (is_inside(cell + tetrahedra[t][i]) ? 1U : 0U) << i;
      for (const Triangle& triangle : triangles[t][mask]) {
        glm::uvec3& face = mesh.faces.emplace_back();
        for (int k = 0; k < 3; ++k) {
          const Edge& edge = triangle[static_cast<std::size_t>(k)];
          face[k] = vertices.find(cell + tetrahedra[t][static_cast<std::size_t>(edge[0])],
                                  cell + tetrahedra[t][static_cast<std::size_t>(edge[1])]);
        }
      }
    }
  };
  for (int z = 0; z + 1 < grid.size.z; ++z) {
    for (int y = 0; y + 1 < grid.size.y; ++y) {
      for (int x = 0; x + 1 < grid.size.x; ++x) march({x, y, z});
    }
  }
  return mesh;
}

}  // namespace dpr
