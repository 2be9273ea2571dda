// PNG files, by libpng.
#include <png.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <new>
#include <stdexcept>
#include <string>

#include "base/checks.hpp"
#include "image/codec.hpp"

namespace dpr {
namespace {

/// Content on its way through libpng, whose errors leave by longjmp(): functions that call setjmp() have nothing to
/// destroy.
class Decoder {
 public:
  explicit Decoder(std::span<const unsigned char> content) : left_(content) {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, fail, [](png_structp, png_const_charp) {});
    if (png_ != nullptr) info_ = png_create_info_struct(png_);
    if (info_ == nullptr) {
      png_destroy_read_struct(&png_, nullptr, nullptr);
      throw std::bad_alloc();
    }
    png_set_read_fn(png_, this, take);
  }
  ~Decoder() { png_destroy_read_struct(&png_, &info_, nullptr); }
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;

  /// Reads what comes before the pixels, which are 8 or 16 bits a channel, of grey or RGB, from here on.
  void start() { require(has_started()); }
  void read(std::vector<png_bytep>& rows) { require(has_read(rows.data())); }

  std::size_t width() const { return png_get_image_width(png_, info_); }
  std::size_t height() const { return png_get_image_height(png_, info_); }
  std::size_t channels() const { return png_get_channels(png_, info_); }
  std::size_t bytes_of_channel() const { return png_get_bit_depth(png_, info_) / 8; }
  bool has_exif() const { return png_get_valid(png_, info_, PNG_INFO_eXIf) != 0; }

 private:
  void require(bool is_done) const {
    if (!is_done) throw std::runtime_error("cannot be read: " + std::string(reason_.data()));
  }

  [[noreturn]] static void fail(png_structp png, png_const_charp reason) {
    std::array<char, 256>& kept = static_cast<Decoder*>(png_get_error_ptr(png))->reason_;
    std::strncpy(kept.data(), reason, kept.size() - 1);
    png_longjmp(png, 1);
  }

  static void take(png_structp png, png_bytep to, png_size_t count) {
    std::span<const unsigned char>& left = static_cast<Decoder*>(png_get_io_ptr(png))->left_;
    if (count > left.size()) png_error(png, "the file ends too soon");
    std::copy_n(left.data(), count, to);
    left = left.subspan(count);
  }

  bool has_started() {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    png_set_user_limits(png_, PNG_UINT_31_MAX, PNG_UINT_31_MAX);  // whoever reads says what is too large
    png_read_info(png_, info_);
    png_set_expand(png_);
    png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    return true;
  }

  bool has_read(png_bytepp rows) {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    png_read_image(png_, rows);
    png_read_end(png_, nullptr);
    return true;
  }

  std::span<const unsigned char> left_;
  std::array<char, 256> reason_{};
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
};

Image decode(Decoder& decoder, std::size_t content_bytes, PixelFacts& facts) {
  constexpr std::size_t k_most_packed = 1032;  // bytes in one of a deflated stream
  const std::size_t width = decoder.width(), height = decoder.height(), channels = decoder.channels(),
                    size = decoder.bytes_of_channel(), row_bytes = width * channels * size;
  if (std::max(width, height) > std::size_t{checks::k_largest_side})
    throw std::runtime_error("got " + std::to_string(width) + "x" + std::to_string(height) +
                             " pixels, expected 1 to " + std::to_string(checks::k_largest_side) +
                             " on a side");
  if (row_bytes / k_most_packed * height > content_bytes)
    throw std::runtime_error("cannot be read: the file ends too soon");
  std::vector<png_byte> bytes(row_bytes * height);
  std::vector<png_bytep> rows;
  for (std::size_t row = 0; row < height; ++row) rows.push_back(bytes.data() + row * row_bytes);
  decoder.read(rows);

  const bool is_grey = channels < 3, has_alpha = channels % 2 == 0;
  facts = {.has_alpha = has_alpha, .floats = false, .largest = size == 2 ? 65535.0F : 255.0F};
  const float unit = 1 / facts.largest;
  const auto value = [&](std::size_t pixel, std::size_t channel) {
    const png_byte* const at = bytes.data() + (pixel * channels + channel) * size;
    const unsigned number = size == 2 ? at[0] * 256U + at[1] : at[0];
    return static_cast<float>(number) * unit;
  };
  Image image(static_cast<int>(width), static_cast<int>(height), glm::vec4(1));
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) image.pixels[i][static_cast<int>(c)] = value(i, is_grey ? 0 : c);
    if (has_alpha) image.pixels[i].w = value(i, channels - 1);
  }
  return image;
}

/// Empty where this is no PNG, or has Exif's data, which libpng does not read.
Image read(const std::string&, std::span<const unsigned char> content, PixelFacts& facts) {
  constexpr std::size_t k_signature = 8;
  if (content.size() < k_signature || png_sig_cmp(content.data(), 0, k_signature) != 0) return {};
  Decoder decoder(content);
  decoder.start();
  return decoder.has_exif() ? Image() : decode(decoder, content.size(), facts);
}

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

constexpr ImageCodec k_codec{read, encode, nullptr};

}  // namespace
}  // namespace dpr

extern "C" DPR_API const dpr::ImageCodec* dpr_image_codec() { return &dpr::k_codec; }
