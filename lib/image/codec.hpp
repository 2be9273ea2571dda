// The libraries that know image files. Each is behind a module, which is loaded when the first file needs it:
// OpenImageIO brings some 260 libraries, which take longer to load than most images to render.
#pragma once

#include <string>
#include <vector>

#include "dpr/export.h"
#include "dpr/image.hpp"

namespace dpr {

/// What the pixels of a file are.
struct PixelFormat {
  std::string extension;  ///< of the file, without the dot
  int channels = 4;       ///< 3 or 4
  bool bytes = true;      ///< 8 bits a channel, or else floats
};

/// What a module does. Its functions throw std::runtime_error with the reason. Where it only writes, those
/// that read are null.
struct ImageCodec {
  /// As the function of image/image_file.hpp.
  bool (*holds_floats)(const std::string& file);
  /// As read_image(), but for the finiteness of the pixels.
  Image (*read)(const std::string& file, bool& has_alpha);
  /// The content of a file of a valid image, in memory.
  std::vector<unsigned char> (*encode)(const Image& image, const PixelFormat& format);
};

/// The function by which a module names its codec.
inline constexpr const char* k_image_codec_symbol = "dpr_image_codec";
using ImageCodecFunction = const ImageCodec*();

}  // namespace dpr
