// Which texture a face has.
#pragma once

#include <cstddef>
#include <cstdint>

#include "dpr/mesh.hpp"

namespace dpr {

/// An index of Mesh::textures, or k_no_texture.
inline std::uint32_t texture_of(const Mesh& mesh, std::size_t face) {
  if (mesh.textures.empty()) return k_no_texture;
  return mesh.face_textures.empty() ? 0 : mesh.face_textures[face];
}

}  // namespace dpr
