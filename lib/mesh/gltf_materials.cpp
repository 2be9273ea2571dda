#include "mesh/gltf_materials.hpp"

#include <algorithm>

#include "image/codec.hpp"
#include "mesh/mesh_reader.hpp"

namespace dpr {
namespace {

glm::vec4 gltf_numbers(const JsonNode& list, std::size_t count) {
  glm::vec4 numbers(0);
  int i = 0;
  for (const JsonNode& number : list.elements(count)) numbers[i++] = number.number();
  return numbers;
}

std::optional<float> threshold_of(const JsonNode& material, float alpha) {
  const std::optional<JsonNode> mode = material.find("alphaMode"), cutoff = material.find("alphaCutoff");
  if (!mode || mode->string() == "OPAQUE") return 0.0F;
  if (mode->string() == "BLEND") return {};
  if (mode->string() != "MASK") mode->fail("\"" + mode->string() + "\"", "OPAQUE, MASK or BLEND");
  const float least = cutoff ? cutoff->number() : 0.5F;
  return least > 0 ? least / alpha : 0.0F;
}

/// Makes opacities 0 or 1; none where all are 1.
void mask(Texture& texture, const std::optional<float>& threshold) {
  if (!threshold) return;
  if (texture.opacities.empty() && *threshold > 1) texture.opacities.assign(texture.texels.size(), 1.0F);
  for (float& opacity : texture.opacities) opacity = opacity >= *threshold ? 1.0F : 0.0F;
  if (std::ranges::all_of(texture.opacities, [](float opacity) { return opacity == 1; }))
    texture.opacities.clear();
}

}  // namespace

glm::vec4 gltf_numbers_or(const JsonNode& node, std::string_view key, std::size_t count,
                          const glm::vec4& otherwise) {
  const std::optional<JsonNode> list = node.find(key);
  return list ? gltf_numbers(*list, count) : otherwise;
}

const BaseColor& GltfMaterials::base_color(const JsonNode& number) {
  const JsonNode& material = document_.named("materials", number);
  const auto [place, is_new] = colors_.try_emplace(number.whole_number(k_largest_index));
  BaseColor& color = place->second;
  if (!is_new) return color;
  std::string unread;
  const auto look_for = [&](const JsonNode& node, std::initializer_list<std::string_view> keys) {
    for (const std::string_view key : keys) {
      if (node.find(key)) unread += (unread.empty() ? "" : ", ") + std::string(key);
    }
  };
  look_for(material, {"emissiveTexture", "normalTexture", "occlusionTexture"});
  const std::optional<JsonNode> surface = material.find("pbrMetallicRoughness");
  if (surface) {
    look_for(*surface, {"metallicRoughnessTexture"});
    const glm::vec4 factor = gltf_numbers_or(*surface, "baseColorFactor", 4, glm::vec4(1));
    color.factor = glm::vec3(factor);
    color.alpha = glm::clamp(factor.a, 0.0F, 1.0F);
  }
  color.threshold = threshold_of(material, color.alpha);
  if (const std::optional<JsonNode> texture = surface ? surface->find("baseColorTexture") : surface)
    read_texture_of(*texture, color);
  if (!unread.empty()) note(material, "not read: " + unread);
  return color;
}

void GltfMaterials::read_texture_of(const JsonNode& reference, BaseColor& color) {
  std::uint64_t set = 0;
  if (const std::optional<JsonNode> texcoord = reference.find("texCoord"))
    set = texcoord->whole_number(k_largest_index);
  if (const std::optional<JsonNode> extensions = reference.find("extensions")) {
    if (const std::optional<JsonNode> moved = extensions->find("KHR_texture_transform")) {
      color.transform.offset = glm::vec2(gltf_numbers_or(*moved, "offset", 2, glm::vec4(0)));
      color.transform.scale = glm::vec2(gltf_numbers_or(*moved, "scale", 2, glm::vec4(1)));
      if (const std::optional<JsonNode> rotation = moved->find("rotation"))
        color.transform.rotation = rotation->number();
      if (const std::optional<JsonNode> texcoord = moved->find("texCoord"))
        set = texcoord->whole_number(k_largest_index);
    }
  }
  color.texcoords = "TEXCOORD_" + std::to_string(set);
  const JsonNode index = reference.at("index");
  const JsonNode& texture = document_.named("textures", index);
  const auto [place, is_new] =
      textures_.try_emplace(std::pair(index.whole_number(k_largest_index), color.threshold), k_no_texture);
  if (is_new) {
    std::optional<Texture> read = image_of(texture);
    if (read) {
      if (const std::optional<JsonNode> sampler = texture.find("sampler"))
        apply_sampler(document_.named("samplers", *sampler), *read);
      mask(*read, color.threshold);
      place->second = static_cast<std::uint32_t>(mesh_textures_.size());
      mesh_textures_.push_back(std::move(*read));
    }
  }
  color.texture = place->second;
}

std::optional<Texture> GltfMaterials::image_of(const JsonNode& texture) {
  const std::optional<JsonNode> source = texture.find("source");
  if (!source) {
    note(texture, "no image that is read: its faces have their other colours alone");
    return {};
  }
  const JsonNode& image = document_.named("images", *source);
  if (const std::optional<JsonNode> view = image.find("bufferView"))
    return decode_texture(image.name(), document_.view(*view));
  const JsonNode uri = image.at("uri");
  std::string data;
  if (GltfDocument::decode(uri, data)) return decode_texture(image.name(), data);
  const std::filesystem::path path = document_.beside(uri);
  std::error_code error;
  if (std::filesystem::is_regular_file(path, error)) return read_texture(path);
  note(uri, "the texture \"" + uri.string() + "\"" + what_is_wrong(path) +
                ": its faces have their other colours alone");
  return {};
}

void GltfMaterials::apply_sampler(const JsonNode& sampler, Texture& texture) {
  const auto value = [&](std::string_view key, std::uint64_t otherwise) {
    const std::optional<JsonNode> found = sampler.find(key);
    return found ? found->whole_number(k_largest_index) : otherwise;
  };
  constexpr std::uint64_t k_repeat = 10497, k_clamp = 33071, k_mirror = 33648, k_nearest = 9728;
  constexpr std::uint64_t k_first_of_mips = 9984, k_last_of_mips = 9987;
  const std::uint64_t wrap = value("wrapS", k_repeat);
  if (wrap == k_clamp) texture.wrap = Wrap::clamp;
  if (wrap == k_mirror) texture.wrap = Wrap::mirror;
  if (value("wrapT", k_repeat) != wrap) note(sampler, "\"wrapT\" is not read: both ways as \"wrapS\"");
  const std::uint64_t smaller = value("minFilter", 0);
  if (smaller >= k_first_of_mips && smaller <= k_last_of_mips) {
    texture.filter = Filter::trilinear;
  } else if (value("magFilter", 0) == k_nearest) {
    texture.filter = Filter::nearest;
  }
}

}  // namespace dpr
