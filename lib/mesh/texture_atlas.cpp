#include "mesh/texture_atlas.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "base/checks.hpp"

namespace dpr {
namespace {

constexpr int k_least_square = 4;

int squares_of_row(std::size_t faces) {
  return std::max(static_cast<int>(std::ceil(std::sqrt(static_cast<double>((faces + 1) / 2)))), 1);
}

std::array<glm::vec3, 3> corner_colors(const Mesh& mesh, std::size_t f) {
  if (!mesh.face_colors.empty()) return {mesh.face_colors[f], mesh.face_colors[f], mesh.face_colors[f]};
  if (mesh.vertex_colors.empty()) return {glm::vec3(1), glm::vec3(1), glm::vec3(1)};
  const glm::uvec3& face = mesh.faces[f];
  return {mesh.vertex_colors[face.x], mesh.vertex_colors[face.y], mesh.vertex_colors[face.z]};
}

}  // namespace

TextureAtlas::TextureAtlas(std::size_t faces, int side)
    : side_(side), per_row_(squares_of_row(faces)), size_(side / per_row_) {
  if (size_ >= k_least_square && side <= k_most_side) return;
  throw InvalidArgument("side (texture)", checks::text(side),
                        "at least " + std::to_string(least_side(faces)) + " for " + std::to_string(faces) +
                            " triangles, and at most " + std::to_string(k_most_side));
}

int TextureAtlas::least_side(std::size_t faces) { return k_least_square * squares_of_row(faces); }

glm::ivec2 TextureAtlas::first_corner(std::size_t face) const {
  const int square = static_cast<int>(face / 2);
  return size_ * glm::ivec2(square % per_row_, square / per_row_) + (face % 2 == 0 ? 0 : size_ - 1);
}

std::array<glm::vec2, 3> TextureAtlas::texcoords(std::size_t face) const {
  const glm::ivec2 first = first_corner(face);
  const int step = face % 2 == 0 ? leg() : -leg();
  const auto coordinates = [&](const glm::ivec2& texel) {
    const glm::vec2 place = (glm::vec2(texel) + 0.5F) / static_cast<float>(side_);
    return glm::vec2(place.x, 1 - place.y);
  };
  return {coordinates(first), coordinates(first + glm::ivec2(step, 0)),
          coordinates(first + glm::ivec2(0, step))};
}

Mesh with_atlas(Mesh mesh, int side) {
  const TextureAtlas atlas(mesh.faces.size(), side);
  const auto width = static_cast<std::size_t>(side), texels = width * width;
  Texture texture{side, side, std::vector<glm::vec3>(texels), Wrap::clamp, Filter::bilinear};
  mesh.texcoords.clear();
  mesh.face_texcoords.clear();
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const auto base = static_cast<std::uint32_t>(mesh.texcoords.size());
    for (const glm::vec2& coordinates : atlas.texcoords(f)) mesh.texcoords.push_back(coordinates);
    mesh.face_texcoords.emplace_back(base, base + 1, base + 2);
    const std::array<glm::vec3, 3> colors = corner_colors(mesh, f);
    atlas.for_texels(f, [&](std::size_t texel, const glm::ivec2& place) {
      glm::vec2 part = glm::vec2(place) / static_cast<float>(atlas.leg());
      part /= std::max(part.x + part.y, 1.0F);  // beyond the edge as on it
      texture.texels[texel] = (1 - part.x - part.y) * colors[0] + part.x * colors[1] + part.y * colors[2];
    });
  }
  mesh.textures = {std::move(texture)};
  mesh.face_textures.clear();
  mesh.vertex_colors.clear();
  mesh.face_colors.clear();
  return mesh;
}

}  // namespace dpr
