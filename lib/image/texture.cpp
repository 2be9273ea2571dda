// Textures: what makes one that can be rendered, and its files.
#include "dpr/texture.hpp"

#include <cmath>

#include "base/checks.hpp"
#include "base/input_file.hpp"
#include "dpr/image.hpp"
#include "image/image_file.hpp"

namespace dpr {
namespace {

// IEC 61966-2-1: a line near black, a power above it.
constexpr float k_end_of_line = 0.0031308F, k_slope = 12.92F, k_offset = 0.055F, k_power = 2.4F;

float decode_srgb(float encoded) {
  if (encoded <= k_end_of_line * k_slope) return encoded / k_slope;
  return std::pow((encoded + k_offset) / (1 + k_offset), k_power);
}

float encode_srgb(float linear) {
  if (linear <= k_end_of_line) return linear * k_slope;
  return (1 + k_offset) * std::pow(linear, 1 / k_power) - k_offset;
}

glm::vec3 by_channel(const glm::vec3& color, float (*transfer)(float)) {
  return {transfer(color.r), transfer(color.g), transfer(color.b)};
}

void validate_size(const Texture& texture, const std::string& name) {
  for (const int side : {texture.width, texture.height}) {
    if (side >= 1 && side <= checks::k_largest_side) continue;
    throw InvalidArgument(checks::in("size", name), checks::size(texture.width, texture.height),
                          "1 to " + std::to_string(checks::k_largest_side) + " texels a side");
  }
  const std::size_t expected =
      static_cast<std::size_t>(texture.width) * static_cast<std::size_t>(texture.height);
  if (texture.texels.size() == expected) return;
  throw InvalidArgument(checks::in("texels", name), std::to_string(texture.texels.size()),
                        std::to_string(expected) + ", width x height");
}

void validate_words(const Texture& texture, const std::string& name) {
  const auto wrap = static_cast<int>(texture.wrap), filter = static_cast<int>(texture.filter);
  if (wrap < 0 || wrap > static_cast<int>(Wrap::clamp))
    throw InvalidArgument(checks::in("wrap", name), std::to_string(wrap), "repeat, mirror or clamp");
  if (filter < 0 || filter > static_cast<int>(Filter::trilinear))
    throw InvalidArgument(checks::in("filter", name), std::to_string(filter),
                          "nearest, bilinear or trilinear");
}

}  // namespace

void validate(const Texture& texture, const std::string& name) {
  validate_size(texture, name);
  validate_words(texture, name);
  for (std::size_t i = 0; i < texture.texels.size(); ++i) {
    if (checks::is_finite(texture.texels[i])) continue;
    throw InvalidArgument(checks::in(checks::element("texels", i), name), checks::text(texture.texels[i]),
                          "finite numbers");
  }
}

Texture read_texture(const std::filesystem::path& file) {
  const bool is_linear = holds_floats(file);
  const Image image = read_image(file);
  Texture texture;
  texture.width = image.width;
  texture.height = image.height;
  texture.texels.reserve(image.pixels.size());
  for (const glm::vec4& pixel : image.pixels)
    texture.texels.push_back(is_linear ? glm::vec3(pixel) : by_channel(glm::vec3(pixel), decode_srgb));
  return texture;
}

void write_texture(const std::filesystem::path& file, const Texture& texture) {
  validate(texture, "texture for " + file.string());
  const bool is_linear = lower_case_extension(file) == ".exr";
  Image image(texture.width, texture.height);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const glm::vec3& texel = texture.texels[i];
    image.pixels[i] = glm::vec4(is_linear ? texel : by_channel(texel, encode_srgb), 1);
  }
  write_image(file, image);
}

}  // namespace dpr
