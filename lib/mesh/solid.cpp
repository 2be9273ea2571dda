#include "mesh/solid.hpp"

#include <algorithm>
#include <iterator>
#include <numeric>

namespace dpr {
namespace {

/// The least of the faces joined to one so far; the way there is halved.
std::uint32_t root_of(std::vector<std::uint32_t>& parents, std::uint32_t face) {
  while (parents[face] != face) {
    parents[face] = parents[parents[face]];
    face = parents[face];
  }
  return face;
}

bool is_inner(const WeldedEdge& edge) { return edge.other && !edge.same_direction; }

}  // namespace

Solid::Solid(std::span<const WeldedEdge> edges, std::size_t faces) {
  is_closed_ = !edges.empty() && std::ranges::all_of(edges, is_inner);
  if (!is_closed_) return;
  std::ranges::copy_if(edges, std::back_inserter(split_edges_),
                       [](const WeldedEdge& edge) { return !edge.shares_vertices; });
  std::vector<std::uint32_t> parents(faces);
  std::iota(parents.begin(), parents.end(), 0U);
  for (const WeldedEdge& edge : edges) {
    const std::uint32_t a = root_of(parents, edge.face), b = root_of(parents, *edge.other);
    parents[std::max(a, b)] = std::min(a, b);
  }
  part_of_face_.resize(faces);
  for (std::uint32_t face = 0; face < faces; ++face) {
    const std::uint32_t root = root_of(parents, face);
    part_of_face_[face] = root == face ? static_cast<std::uint32_t>(parts_++) : part_of_face_[root];
  }
  if (parts_ == 1) part_of_face_ = std::vector<std::uint32_t>();  // `= {}` would keep the memory
}

bool Solid::is_closed_at(std::span<const glm::vec3> positions, std::span<const glm::uvec3> faces) const {
  const auto meet = [&](const WeldedEdge& edge) {
    const glm::uvec3& other = faces[*edge.other];
    const auto touches = [&](std::uint32_t end) {
      return positions[end] == positions[other.x] || positions[end] == positions[other.y] ||
             positions[end] == positions[other.z];
    };
    return touches(edge.first) && touches(edge.second);
  };
  return is_closed_ && std::ranges::all_of(split_edges_, meet);
}

int Solid::winding(std::span<const glm::vec3> positions, std::span<const glm::uvec3> faces) const {
  if (!is_closed_) return 0;
  const glm::dvec3 origin(positions[faces[0].x]);
  std::vector<double> volumes(parts_);
  for (std::size_t face = 0; face < faces.size(); ++face) {
    const std::size_t part = part_of_face_.empty() ? 0 : part_of_face_[face];
    const auto corner = [&](int i) { return glm::dvec3(positions[faces[face][i]]) - origin; };
    volumes[part] += glm::dot(corner(0), glm::cross(corner(1), corner(2)));
  }
  if (std::ranges::all_of(volumes, [](double volume) { return volume > 0; })) return 1;
  return std::ranges::all_of(volumes, [](double volume) { return volume < 0; }) ? -1 : 0;
}

}  // namespace dpr
