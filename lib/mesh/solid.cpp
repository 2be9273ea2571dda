#include "mesh/solid.hpp"

#include <algorithm>
#include <numeric>

namespace dpr {
namespace {

/// The least of the elements joined to one so far; the way there is halved.
std::uint32_t root_of(std::vector<std::uint32_t>& parents, std::uint32_t element) {
  while (parents[element] != element) {
    parents[element] = parents[parents[element]];
    element = parents[element];
  }
  return element;
}

void join(std::vector<std::uint32_t>& parents, std::uint32_t a, std::uint32_t b) {
  const std::uint32_t root_a = root_of(parents, a), root_b = root_of(parents, b);
  parents[std::max(root_a, root_b)] = std::min(root_a, root_b);
}

std::vector<std::uint32_t> each_alone(std::size_t count) {
  std::vector<std::uint32_t> parents(count);
  std::iota(parents.begin(), parents.end(), 0U);
  return parents;
}

bool is_inner(const WeldedEdge& edge) { return edge.other && !edge.same_direction; }

}  // namespace

Solid::Solid(std::span<const WeldedEdge> edges, std::size_t faces) : faces_(faces) {
  may_be_closed_ = !edges.empty() && std::ranges::all_of(edges, [](const WeldedEdge& edge) {
    return edge.is_open || is_inner(edge);
  });
  if (!may_be_closed_) return;
  std::vector<std::uint32_t> parents = each_alone(faces);
  for (const WeldedEdge& edge : edges) {
    if (edge.is_open) {
      open_edges_.push_back(edge);
    } else {
      join(parents, edge.face, *edge.other);
    }
  }
  patch_of_face_.resize(faces);
  for (std::uint32_t face = 0; face < faces; ++face) {
    const std::uint32_t root = root_of(parents, face);
    patch_of_face_[face] = root == face ? patches_++ : patch_of_face_[root];
  }
  if (patches_ == 1) patch_of_face_ = std::vector<std::uint32_t>();  // `= {}` would keep the memory
}

namespace {

/// Six times the volumes by patch, of the tetrahedra between the faces and a point; `patch_of` is that of a face.
template <class PatchOf>
std::vector<double> volumes_of(std::span<const glm::vec3> positions, std::span<const glm::uvec3> faces,
                               std::size_t patches, const PatchOf& patch_of) {
  const glm::dvec3 origin(positions[faces[0].x]);
  std::vector<double> volumes(patches);
  double volume = 0;  // of the patch at hand: sums in memory would wait for each other
  std::uint32_t patch = patch_of(0);
  for (std::size_t face = 0; face < faces.size(); ++face) {
    if (const std::uint32_t own = patch_of(face); own != patch) {
      volumes[patch] = volume;
      patch = own;
      volume = volumes[patch];
    }
    const auto corner = [&](int i) { return glm::dvec3(positions[faces[face][i]]) - origin; };
    volume += glm::dot(corner(0), glm::cross(corner(1), corner(2)));
  }
  volumes[patch] = volume;
  return volumes;
}

}  // namespace

int Solid::winding(std::span<const glm::vec3> positions, std::span<const glm::uvec3> faces) const {
  if (!may_be_closed_) return 0;
  faces = faces.first(faces_);
  std::vector<WeldedEdge> joined = open_edges_;
  join_open(positions, faces, joined);
  if (!std::ranges::all_of(joined, is_inner)) return 0;
  const auto patch_of = [&](std::size_t face) { return patch_of_face_.empty() ? 0U : patch_of_face_[face]; };
  std::vector<std::uint32_t> parents = each_alone(patches_);
  for (const WeldedEdge& edge : joined) join(parents, patch_of(edge.face), patch_of(*edge.other));
  const std::vector<double> volumes =
      patches_ == 1 ? volumes_of(positions, faces, 1, [](std::size_t) { return 0U; })
                    : volumes_of(positions, faces, patches_,
                                 [&](std::size_t face) { return root_of(parents, patch_of(face)); });
  const auto all_are = [&](int sign) {
    for (std::uint32_t patch = 0; patch < patches_; ++patch) {
      if (parents[patch] == patch && !(sign * volumes[patch] > 0)) return false;
    }
    return true;
  };
  if (all_are(1)) return 1;
  return all_are(-1) ? -1 : 0;
}

}  // namespace dpr
