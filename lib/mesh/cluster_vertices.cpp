// Vertices of a grid's cells become one.
#include "mesh/cluster_vertices.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>

namespace dpr {
namespace {

struct Sum {
  glm::dvec3 position{0.0}, color{0.0};
  double opacity = 0, count = 0;
};

/// The cell of every vertex, counted in the order of first use.
std::vector<std::uint32_t> assign_cells(const Mesh& mesh, float cell) {
  std::map<std::array<std::int64_t, 3>, std::uint32_t> cells;
  std::vector<std::uint32_t> result;
  result.reserve(mesh.positions.size());
  for (const glm::vec3& p : mesh.positions) {
    const auto index = [&](float x) {
      return static_cast<std::int64_t>(std::floor(static_cast<double>(x) / static_cast<double>(cell)));
    };
    result.push_back(
        cells.try_emplace({index(p.x), index(p.y), index(p.z)}, static_cast<std::uint32_t>(cells.size()))
            .first->second);
  }
  return result;
}

/// The same corners in the same direction, beginning with the least.
std::array<std::uint32_t, 3> canonical(const glm::uvec3& face) {
  std::array<std::uint32_t, 3> corners{face.x, face.y, face.z};
  std::rotate(corners.begin(), std::ranges::min_element(corners), corners.end());
  return corners;
}

}  // namespace

Mesh cluster_vertices(const Mesh& mesh, float cell) {
  const std::vector<std::uint32_t> cells = assign_cells(mesh, cell);
  std::vector<Sum> sums(*std::ranges::max_element(cells) + std::size_t{1});
  for (std::size_t i = 0; i < cells.size(); ++i) {
    Sum& sum = sums[cells[i]];
    sum.position += glm::dvec3(mesh.positions[i]);
    if (!mesh.vertex_colors.empty()) sum.color += glm::dvec3(mesh.vertex_colors[i]);
    if (!mesh.vertex_opacities.empty()) sum.opacity += static_cast<double>(mesh.vertex_opacities[i]);
    ++sum.count;
  }
  Mesh result;
  result.texcoords = mesh.texcoords;
  result.textures = mesh.textures;
  result.materials = mesh.materials;
  for (const Sum& sum : sums) {
    result.positions.emplace_back(sum.position / sum.count);
    if (!mesh.vertex_colors.empty()) result.vertex_colors.emplace_back(sum.color / sum.count);
    if (!mesh.vertex_opacities.empty())
      result.vertex_opacities.push_back(static_cast<float>(sum.opacity / sum.count));
  }
  std::set<std::array<std::uint32_t, 3>> known;
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    const glm::uvec3 face(cells[mesh.faces[i].x], cells[mesh.faces[i].y], cells[mesh.faces[i].z]);
    if (face.x == face.y || face.y == face.z || face.z == face.x) continue;
    if (!known.insert(canonical(face)).second) continue;
    result.faces.push_back(face);
    if (!mesh.face_colors.empty()) result.face_colors.push_back(mesh.face_colors[i]);
    if (!mesh.face_opacities.empty()) result.face_opacities.push_back(mesh.face_opacities[i]);
    if (!mesh.face_texcoords.empty()) result.face_texcoords.push_back(mesh.face_texcoords[i]);
    if (!mesh.face_textures.empty()) result.face_textures.push_back(mesh.face_textures[i]);
    if (!mesh.face_materials.empty()) result.face_materials.push_back(mesh.face_materials[i]);
  }
  return result.faces.empty() ? mesh : result;
}

}  // namespace dpr
