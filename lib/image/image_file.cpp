// Images on disk: what holds for every format, and which library knows it.
#include "dpr/image.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "base/checks.hpp"
#include "base/input_file.hpp"
#include "base/module.hpp"
#include "base/output_file.hpp"
#include "dpr/error.hpp"
#include "image/codec.hpp"
#include "image/srgb.hpp"

namespace dpr {
namespace {

struct Format {
  std::string_view extension;
  int channels;
  bool bytes;
};

constexpr std::array<Format, 9> k_image_formats{{{".exr", 4, false},
                                                 {".png", 4, true},
                                                 {".tif", 4, true},
                                                 {".tiff", 4, true},
                                                 {".tga", 4, true},
                                                 {".bmp", 3, true},
                                                 {".jpg", 3, true},
                                                 {".jpeg", 3, true},
                                                 {".ppm", 3, true}}};

const Format& format_of(const std::filesystem::path& file) {
  const std::string extension = lower_case_extension(file);
  std::string known;
  for (const Format& format : k_image_formats) {
    if (format.extension == extension) return format;
    if (!known.empty()) known += ", ";
    known += format.extension;
  }
  throw IoError(file, "got the extension \"" + extension + "\", expected one of " + known);
}

std::string pixel_name(std::size_t index, int width) {
  const auto row_length = static_cast<std::size_t>(width);
  return "column " + std::to_string(index % row_length) + ", row " + std::to_string(index / row_length);
}

bool is_finite(const glm::vec4& pixel) {
  return std::isfinite(pixel.r) && std::isfinite(pixel.g) && std::isfinite(pixel.b) && std::isfinite(pixel.a);
}

void require_finite(const std::filesystem::path& file, const Image& image) {
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    if (is_finite(image.pixels[i])) continue;
    throw IoError(file, "the pixel in " + pixel_name(i, image.width) + " is not finite");
  }
}

/// Colours below 0 are what formats of bytes hold least of.
Image encoded(Image image) {
  for (glm::vec4& pixel : image.pixels) pixel = transferred(glm::max(pixel, 0.0F), encode_srgb);
  return image;
}

const ImageCodec& load_codec(const char* module) {
  const auto codec = reinterpret_cast<ImageCodecFunction*>(module_function(module, k_image_codec_symbol));
  return *codec();
}

const ImageCodec& openimageio() {
  static const ImageCodec& codec = load_codec("openimageio");
  return codec;
}

/// PNG is what most images are: libpng alone is loaded in no time.
const ImageCodec& png() {
  static const ImageCodec& codec = load_codec("png");
  return codec;
}

std::span<const unsigned char> bytes_of(std::string_view content) {
  return {reinterpret_cast<const unsigned char*>(content.data()), content.size()};
}

/// As ImageCodec::read. Messages call the file `name`.
Image read_stored(const std::filesystem::path& name, const std::string& file, std::string_view content,
                  PixelFacts& facts) {
  const bool is_png_file = content.empty() && lower_case_extension(name) == ".png";
  const std::string of_file = is_png_file ? read_file(name) : std::string();
  const std::string_view of_png = file == "png" ? content : of_file;
  try {
    if (!of_png.empty()) {
      if (Image image = png().read("png", bytes_of(of_png), facts); !image.pixels.empty()) return image;
    }
    return openimageio().read(file, bytes_of(content), facts);
  } catch (const std::runtime_error& error) {
    throw IoError(name, error.what());
  }
}

/// Finite, or an IoError, and decoded.
Image linear(const std::filesystem::path& name, Image image, Encoding encoding, const PixelFacts& facts) {
  require_finite(name, image);
  if (encoding == Encoding::srgb && !facts.floats) {
    for (glm::vec4& pixel : image.pixels) pixel = transferred(pixel, decode_srgb);
  }
  return image;
}

/// As read_stored(), finite and linear.
Image read(const std::filesystem::path& name, const std::string& file, std::string_view content,
           Encoding encoding, PixelFacts& facts) {
  return linear(name, read_stored(name, file, content, facts), encoding, facts);
}

Texture texture_of(const Image& image) {
  Texture texture;
  texture.width = image.width;
  texture.height = image.height;
  texture.texels.assign(image.pixels.begin(), image.pixels.end());
  if (std::ranges::any_of(image.pixels, [](const glm::vec4& pixel) { return pixel.a < 1; })) {
    for (const glm::vec4& pixel : image.pixels) texture.opacities.push_back(glm::clamp(pixel.a, 0.0F, 1.0F));
  }
  return texture;
}

Image image_of(const Texture& texture) {
  Image image(texture.width, texture.height);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = glm::vec4(texture.texels[i], texture.opacities.empty() ? 1 : texture.opacities[i]);
  return image;
}

}  // namespace

Image read_pixels(const std::filesystem::path& file, PixelFacts& facts) {
  require_file(file);
  return read_stored(file, file.string(), {}, facts);
}

Image read_image(const std::filesystem::path& file, Encoding encoding, PixelFacts& facts) {
  require_file(file);
  return read(file, file.string(), {}, encoding, facts);
}

Video::Video(std::filesystem::path file, Encoding encoding) : file_(std::move(file)), encoding_(encoding) {
  require_file(file_);
  try {
    images_ = openimageio().read_all(file_.string());
  } catch (const std::runtime_error& error) {
    throw IoError(file_, error.what());
  }
}

bool Video::next(Image& image) {
  PixelFacts facts;
  try {
    if (!images_->next(image, facts)) return false;
  } catch (const std::runtime_error& error) {
    throw IoError(file_, error.what());
  }
  image = linear(file_, std::move(image), encoding_, facts);
  return true;
}

Texture read_texture(const std::filesystem::path& file) { return texture_of(read_image(file)); }

Texture decode_texture(const std::string& name, std::string_view content) {
  const bool is_png = content.starts_with("\x89PNG");
  if (!is_png && !content.starts_with("\xff\xd8")) throw IoError(name, "is neither a PNG nor a JPEG file");
  PixelFacts facts;
  return texture_of(read(name, is_png ? "png" : "jpeg", content, Encoding::srgb, facts));
}

void write_texture(const std::filesystem::path& file, const Texture& texture) {
  validate(texture, "texture for " + file.string());
  write_image(file, image_of(texture));
}

std::string encode_texture(const std::filesystem::path& file, const Texture& texture) {
  try {
    const std::vector<unsigned char> bytes = png().encode(encoded(image_of(texture)), {.extension = "png"});
    return {bytes.begin(), bytes.end()};
  } catch (const std::runtime_error& error) {
    throw IoError(file, error.what());
  }
}

Image read_image(const std::filesystem::path& file, bool* has_alpha, Encoding encoding) {
  PixelFacts facts;
  Image image = read_image(file, encoding, facts);
  if (has_alpha) *has_alpha = facts.has_alpha;
  return image;
}

void require_image_format(const std::filesystem::path& file) { format_of(file); }

void write_image(const std::filesystem::path& file, const Image& image, Encoding encoding) {
  const Format& format = format_of(file);
  const auto width = static_cast<std::size_t>(std::max(image.width, 0));
  if (image.width < 1 || image.height < 1 ||
      image.pixels.size() != width * static_cast<std::size_t>(image.height)) {
    throw InvalidArgument(
        "image (for " + file.string() + ")",
        checks::size(image.width, image.height) + " with " + std::to_string(image.pixels.size()) + " pixels",
        "at least 1x1, and width times height pixels");
  }
  require_finite(file, image);
  const bool is_srgb = format.bytes && encoding == Encoding::srgb;
  std::vector<unsigned char> bytes;
  try {
    const ImageCodec& codec = format.extension == ".png" ? png() : openimageio();
    const PixelFormat pixels{std::string(format.extension.substr(1)), format.channels, format.bytes, is_srgb};
    bytes = codec.encode(is_srgb ? encoded(image) : image, pixels);
  } catch (const std::runtime_error& error) {
    throw IoError(file, error.what());
  }
  write_whole_file(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace dpr
