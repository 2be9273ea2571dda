// The libraries that know image files. Each is behind a module, which is loaded when the first file needs it:
// OpenImageIO brings some 260 libraries, which take longer to load than most images to render.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dpr/export.h"
#include "dpr/image.hpp"
#include "dpr/texture.hpp"

namespace dpr {

/// Pixel format of a file to write.
struct PixelFormat {
  std::string extension;  ///< of the file, without the dot
  int channels = 4;       ///< 3 or 4
  bool bytes = true;      ///< 8 bits a channel, or else floats
  bool srgb = true;       ///< what a file of bytes says that they are
};

/// Pixel format found in a file.
struct PixelFacts {
  bool has_alpha = false;
  bool floats = false;  ///< or else whole numbers, as parts of the largest one
  float largest = 1;    ///< what that is; 1 of floats
  /// Exif's focal length in mm for a camera of 35-mm film, whose picture has the same diagonal angle of view; 0: unknown.
  float focal_35mm = 0;
};

/// Images of a file that holds several: those of a video, as they are stored.
class StoredImages {
 public:
  virtual ~StoredImages() = default;
  /// The next one; false behind the last. Throws std::runtime_error with the reason.
  virtual bool next(Image& image, PixelFacts& facts) = 0;
};

/// Functions of a codec module. They throw std::runtime_error with the reason.
struct ImageCodec {
  /// The pixels as they are stored, finite or not; whole numbers from 0 to 1. Without `content` those of a file;
  /// else `file` is the name of the content's format. An empty image: another module has to read it.
  Image (*read)(const std::string& file, std::span<const unsigned char> content, PixelFacts& facts);
  /// The content of a file of a valid image, in memory.
  std::vector<unsigned char> (*encode)(const Image& image, const PixelFormat& format);
  /// Null in a module that reads no videos.
  std::unique_ptr<StoredImages> (*read_all)(const std::string& file);
};

/// The function by which a module names its codec.
inline constexpr const char* k_image_codec_symbol = "dpr_image_codec";
using ImageCodecFunction = const ImageCodec*();

/// As the public read_image(), with what the file says of its pixels.
Image read_image(const std::filesystem::path& file, Encoding encoding, PixelFacts& facts);

/// As the public read_texture(), of a PNG or JPEG file's content; `name` is what messages call it.
Texture decode_texture(const std::string& name, std::string_view content);

/// The content of a PNG file of the texture, as write_texture() writes it; an IoError names that file.
std::string encode_texture(const std::filesystem::path& file, const Texture& texture);

/// Images of a video, one after the other, as the public read_image() has them.
class Video {
 public:
  /// Throws IoError, also where the installed OpenImageIO reads no videos.
  Video(std::filesystem::path file, Encoding encoding);

  /// The next one; false behind the last. Throws IoError.
  bool next(Image& image);

 private:
  std::filesystem::path file_;
  Encoding encoding_;
  std::unique_ptr<StoredImages> images_;
};

/// The pixels as they are stored, finite or not. Throws IoError.
Image read_pixels(const std::filesystem::path& file, PixelFacts& facts);

/// Throws IoError unless the extension is of a format that write_image() knows: to be called before the work.
void require_image_format(const std::filesystem::path& file);

}  // namespace dpr
