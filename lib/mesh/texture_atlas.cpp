#include "mesh/texture_atlas.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "base/checks.hpp"

namespace dpr {
namespace {

/// Squares of texels, row by row, each for two triangles: the first has the texels up to the diagonal, the second those
/// beyond it. Their corners lie so far from the diagonal that interpolation at a point takes a triangle's own alone.
class Squares {
 public:
  Squares(std::size_t faces, int side) : side_(side) {
    constexpr int k_least = 4, k_most_side = 16384;
    const auto squares = static_cast<double>((faces + 1) / 2);
    per_row_ = static_cast<int>(std::ceil(std::sqrt(squares)));
    size_ = side / per_row_;
    if (size_ < k_least || side > k_most_side) {
      throw InvalidArgument("side (texture)", checks::text(side),
                            "at least " + std::to_string(k_least * per_row_) + " for " +
                                std::to_string(faces) + " triangles, and at most " +
                                std::to_string(k_most_side));
    }
  }

  int size() const { return size_; }
  /// Texel, column and row, of a face's square at its upper left.
  glm::ivec2 origin(std::size_t face) const {
    const int square = static_cast<int>(face / 2);
    return size_ * glm::ivec2(square % per_row_, square / per_row_);
  }
  /// Of a face's first corner in its square, and texels from there to the next, in x, and to the last, in y.
  int first(std::size_t face) const { return face % 2 == 0 ? 0 : size_ - 1; }
  int leg(std::size_t face) const { return face % 2 == 0 ? size_ - 3 : 3 - size_; }
  glm::vec2 texcoord(const glm::ivec2& texel) const {
    const glm::vec2 place = (glm::vec2(texel) + 0.5F) / static_cast<float>(side_);
    return {place.x, 1 - place.y};
  }

 private:
  int side_, per_row_, size_;
};

std::array<glm::vec3, 3> corner_colors(const Mesh& mesh, std::size_t f) {
  if (!mesh.face_colors.empty()) return {mesh.face_colors[f], mesh.face_colors[f], mesh.face_colors[f]};
  if (mesh.vertex_colors.empty()) return {glm::vec3(1), glm::vec3(1), glm::vec3(1)};
  const glm::uvec3& face = mesh.faces[f];
  return {mesh.vertex_colors[face.x], mesh.vertex_colors[face.y], mesh.vertex_colors[face.z]};
}

}  // namespace

Mesh with_atlas(Mesh mesh, int side) {
  const Squares squares(mesh.faces.size(), side);
  const std::size_t width = static_cast<std::size_t>(std::max(side, 0));
  Texture texture{side, side, std::vector<glm::vec3>(width * width), Wrap::clamp, Filter::bilinear};
  mesh.texcoords.clear();
  mesh.face_texcoords.clear();
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const glm::ivec2 origin = squares.origin(f);
    const int first = squares.first(f), leg = squares.leg(f), last = squares.size() - 1;
    const auto base = static_cast<std::uint32_t>(mesh.texcoords.size());
    for (const glm::ivec2 corner : {glm::ivec2(first), {first + leg, first}, {first, first + leg}})
      mesh.texcoords.push_back(squares.texcoord(origin + corner));
    mesh.face_texcoords.emplace_back(base, base + 1, base + 2);
    const std::array<glm::vec3, 3> colors = corner_colors(mesh, f);
    for (int y = 0; y <= last; ++y) {
      for (int x = 0; x <= last; ++x) {
        if ((x + y <= last) != (f % 2 == 0)) continue;
        glm::vec2 part = glm::max(glm::vec2(x - first, y - first) / static_cast<float>(leg), glm::vec2(0));
        part /= std::max(part.x + part.y, 1.0F);
        const auto texel =
            static_cast<std::size_t>(origin.y + y) * width + static_cast<std::size_t>(origin.x + x);
        texture.texels[texel] = (1 - part.x - part.y) * colors[0] + part.x * colors[1] + part.y * colors[2];
      }
    }
  }
  mesh.textures = {std::move(texture)};
  mesh.face_textures.clear();
  mesh.vertex_colors.clear();
  mesh.face_colors.clear();
  return mesh;
}

}  // namespace dpr
