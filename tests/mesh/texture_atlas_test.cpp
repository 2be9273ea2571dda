// Texture coordinates for meshes that have none.
#include "mesh/texture_atlas.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "dpr/error.hpp"
#include "support/messages.hpp"

namespace texture_atlas_test {

namespace {

using dpr::Mesh;
using dpr::Texture;

/// Texels, column and row, around a place, that bilinear filtering reads.
std::vector<glm::ivec2> texels_around(const Texture& texture, const glm::vec2& uv) {
  const glm::vec2 place(uv.x * static_cast<float>(texture.width) - 0.5F,
                        (1 - uv.y) * static_cast<float>(texture.height) - 0.5F);
  constexpr float k_rounding = 1e-3F;
  std::vector<glm::ivec2> list;
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 2; ++x) {
      const glm::vec2 texel = glm::floor(place + k_rounding) + glm::vec2(x, y);
      const glm::vec2 part = 1.0F - glm::abs(place - texel);
      if (std::min(part.x, part.y) > k_rounding) list.emplace_back(texel);
    }
  }
  return list;
}

template <typename Visit>
void for_points(const Mesh& mesh, std::size_t face, const Visit& visit) {
  constexpr int k_steps = 12;
  const glm::uvec3& corners = mesh.face_texcoords[face];
  for (int i = 0; i <= k_steps; ++i) {
    for (int j = 0; i + j <= k_steps; ++j) {
      const float b = static_cast<float>(i) / k_steps, c = static_cast<float>(j) / k_steps;
      visit((1 - b - c) * mesh.texcoords[corners.x] + b * mesh.texcoords[corners.y] +
                c * mesh.texcoords[corners.z],
            glm::vec3(1 - b - c, b, c));
    }
  }
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("no two triangles of an atlas read the same texel") {
    for (const int side : {28, 33, 64}) {
      const Mesh mesh = dpr::with_atlas(dpr::make_icosphere(1), side);  // 80 triangles
      const Texture& texture = mesh.textures.front();
      std::vector<int> owner(texture.texels.size(), -1);
      int shared = 0, outside = 0;
      for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        for_points(mesh, f, [&](const glm::vec2& uv, const glm::vec3&) {
          for (const glm::ivec2& texel : texels_around(texture, uv)) {
            if (std::min(texel.x, texel.y) < 0 || std::max(texel.x, texel.y) >= side) {
              ++outside;
              continue;
            }
            int& face = owner[static_cast<std::size_t>(texel.y * side + texel.x)];
            if (face >= 0 && face != static_cast<int>(f)) ++shared;
            face = static_cast<int>(f);
          }
        });
      }
      CHECK(shared == 0);
      CHECK(outside == 0);
    }
  }

  TEST_CASE("an atlas shows the mesh's colours") {
    const Mesh sphere = dpr::make_icosphere(1);
    const Mesh mesh = dpr::with_atlas(sphere, 80);
    CHECK(mesh.vertex_colors.empty());
    CHECK_NOTHROW(dpr::validate(mesh));
    const Texture& texture = mesh.textures.front();
    float worst = 0;
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      const glm::uvec3& corners = mesh.faces[f];
      for_points(mesh, f, [&](const glm::vec2& uv, const glm::vec3& part) {
        const glm::vec3 wanted = part.x * sphere.vertex_colors[corners.x] +
                                 part.y * sphere.vertex_colors[corners.y] +
                                 part.z * sphere.vertex_colors[corners.z];
        for (const glm::ivec2& texel : texels_around(texture, uv)) {
          const glm::vec3 difference =
              texture.texels[static_cast<std::size_t>(texel.y * texture.width + texel.x)] - wanted;
          worst = std::max(worst, glm::length(difference));
        }
      });
    }
    CHECK(worst < 0.15F);  // a texel's side away, 0.1; colours of other corners are 0.8 away
  }

  TEST_CASE("an atlas needs 4x4 texels for two triangles") {
    const Mesh sphere = dpr::make_icosphere(1);
    CHECK(dpr::with_atlas(sphere, 28).textures.front().width == 28);
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::with_atlas(sphere, 27),
                          "side (texture): got 27, expected at least 28 for 80 triangles");
    for (const int side : {0, -5, 16385})
      CHECK_THROWS_AS(dpr::with_atlas(sphere, side), dpr::InvalidArgument);
  }
}

}  // namespace texture_atlas_test
