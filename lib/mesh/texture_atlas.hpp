// Texture coordinates for a mesh that has none.
#pragma once

#include <array>
#include <cstddef>
#include <glm/glm.hpp>

#include "dpr/mesh.hpp"

namespace dpr {

/// Squares of texels in a square texture, row by row, each for two triangles: the first has the texels up to the
/// diagonal, the second those beyond it. Their corners lie so far from the diagonal that interpolation at a point of a
/// triangle takes its own texels alone.
class TextureAtlas {
 public:
  static constexpr int k_most_side = 16384;

  /// Throws InvalidArgument where the squares would be smaller than 4x4 texels, or the side is above k_most_side.
  TextureAtlas(std::size_t faces, int side);
  /// The least side for so many triangles.
  static int least_side(std::size_t faces);

  int side() const { return side_; }
  /// Texels from a triangle's first corner to the next, and to the last.
  int leg() const { return size_ - 3; }
  /// Texture coordinates of a face's corners.
  std::array<glm::vec2, 3> texcoords(std::size_t face) const;
  /// Calls visit(texel, place) for all texels of a face: the number in the texture, row by row, and columns and rows
  /// from the first corner, towards the two others.
  template <typename Visit>
  void for_texels(std::size_t face, const Visit& visit) const {
    const glm::ivec2 corner = first_corner(face);
    const int direction = face % 2 == 0 ? 1 : -1, most = size_ - (face % 2 == 0 ? 1 : 2);
    for (int y = 0; y <= most; ++y) {
      for (int x = 0; x + y <= most; ++x) {
        const glm::ivec2 texel = corner + direction * glm::ivec2(x, y);
        visit(static_cast<std::size_t>(texel.y) * static_cast<std::size_t>(side_) +
                  static_cast<std::size_t>(texel.x),
              glm::ivec2(x, y));
      }
    }
  }

 private:
  glm::ivec2 first_corner(std::size_t face) const;

  int side_, per_row_, size_;
};

/// The mesh with such a texture in the place of its colours, which it shows. Throws as TextureAtlas. O(faces + texels).
Mesh with_atlas(Mesh mesh, int side);

}  // namespace dpr
