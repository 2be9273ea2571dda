// Textures and materials without their numbers: what stays on a renderer from batch to batch.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "dpr/texture.hpp"

namespace dpr::torch_op {

using Faces = std::vector<glm::uvec3>;

/// A texture without its texels.
struct TextureForm {
  int width = 0, height = 0;
  Wrap wrap = Wrap::repeat;
  Filter filter = Filter::bilinear;

  bool operator==(const TextureForm&) const = default;
};

/// As a Mesh (dpr/mesh.hpp) has them; empty: neither textures nor materials.
struct Surface {
  std::size_t texcoords = 0, materials = 0;  ///< how many there are
  Faces face_texcoords;
  std::vector<TextureForm> textures;
  std::vector<std::uint32_t> face_textures, face_materials;

  bool operator==(const Surface&) const = default;
};

}  // namespace dpr::torch_op
