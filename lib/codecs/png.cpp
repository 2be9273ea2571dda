// PNG files, written by libpng.
#include <png.h>

#include <algorithm>
#include <stdexcept>

#include "image/codec.hpp"

namespace dpr {
namespace {

/// Rounded to 8 bits, RGBA.
std::vector<png_byte> to_bytes(const Image& image) {
  constexpr float k_one = 255, k_half = 0.5F;
  std::vector<png_byte> bytes;
  bytes.reserve(4 * image.pixels.size());
  for (const glm::vec4& pixel : image.pixels) {
    for (int c = 0; c < 4; ++c)
      bytes.push_back(static_cast<png_byte>(std::clamp(pixel[c], 0.0F, 1.0F) * k_one + k_half));
  }
  return bytes;
}

std::vector<unsigned char> encode(const Image& image, const PixelFormat& format) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = PNG_FORMAT_RGBA;
  if (!format.srgb) png.flags = PNG_IMAGE_FLAG_COLORSPACE_NOT_sRGB;
  std::vector<unsigned char> file(PNG_IMAGE_PNG_SIZE_MAX(png));
  png_alloc_size_t size = file.size();
  if (png_image_write_to_memory(&png, file.data(), &size, 0, to_bytes(image).data(), 0, nullptr) == 0)
    throw std::runtime_error(std::string("cannot be written: ") + png.message);
  file.resize(size);
  return file;
}

constexpr ImageCodec k_codec{nullptr, encode, nullptr};

}  // namespace
}  // namespace dpr

extern "C" DPR_API const dpr::ImageCodec* dpr_image_codec() { return &dpr::k_codec; }
