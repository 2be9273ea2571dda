// Base colours and opacities of glTF materials, and their textures.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dpr/mesh.hpp"
#include "dpr/notes.hpp"
#include "mesh/gltf_document.hpp"

namespace dpr {

inline constexpr std::uint64_t k_largest_index = std::numeric_limits<std::uint32_t>::max();

/// A member of so many numbers.
glm::vec4 gltf_numbers_or(const JsonNode& node, std::string_view key, std::size_t count,
                          const glm::vec4& otherwise);

/// Coordinates of a texture that is moved within its coordinates (KHR_texture_transform).
struct TextureTransform {
  glm::vec2 offset{0}, scale{1};
  float rotation = 0;  ///< radians

  /// Coordinates with v down.
  glm::vec2 operator()(const glm::vec2& uv) const {
    const glm::vec2 scaled = uv * scale;
    const float c = std::cos(rotation), s = std::sin(rotation);
    return offset + glm::vec2(c * scaled.x + s * scaled.y, c * scaled.y - s * scaled.x);
  }
};

/// What a material says of its colour and opacity.
struct BaseColor {
  glm::vec3 factor{1};
  float alpha = 1;
  /// The least alpha of a texture that is opaque where the factor's is `alpha`; what is less is not seen. None: alpha
  /// is opacity.
  std::optional<float> threshold = 0.0F;
  std::uint32_t texture = k_no_texture;  ///< in the mesh
  std::string texcoords = "TEXCOORD_0";  ///< the attribute
  TextureTransform transform;

  /// The opacity of faces beside that of the texture, if they show one.
  float opacity(bool is_textured) const {
    if (!threshold) return alpha;
    return is_textured || *threshold <= 1 ? 1.0F : 0.0F;
  }
};

class GltfMaterials {
 public:
  /// Adds textures to the mesh's.
  GltfMaterials(GltfDocument& document, Notes& notes, std::vector<Texture>& textures)
      : document_(document), notes_(notes), mesh_textures_(textures) {}

  const BaseColor& base_color(const JsonNode& number);

 private:
  void note(const JsonNode& about, const std::string& text) { notes_.push_back(about.name() + ": " + text); }
  void read_texture_of(const JsonNode& reference, BaseColor& color);
  std::optional<Texture> image_of(const JsonNode& texture);
  void apply_sampler(const JsonNode& sampler, Texture& texture);

  GltfDocument& document_;
  Notes& notes_;
  std::vector<Texture>& mesh_textures_;
  std::map<std::uint64_t, BaseColor> colors_;  // by material
  std::map<std::pair<std::uint64_t, std::optional<float>>, std::uint32_t>
      textures_;  // by texture and threshold
};

}  // namespace dpr
