// Images in memory and on disk.
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "dpr/export.h"
#include "dpr/vectors.hpp"

namespace dpr {

/// Linear RGBA in floats, row 0 on top; colour is what is seen over the background, and alpha is the
/// silhouette: the colour is not to be blended by it again.
struct Image {
  int width = 0, height = 0;
  std::vector<vec4> pixels;  ///< [height * width], row-major

  Image() = default;
  /// Of sides of 0 or more.
  Image(int width_, int height_, vec4 fill = vec4(0))
      : width(width_),
        height(height_),
        pixels(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_), fill) {}

  vec4& at(int column, int row) { return pixels[index(column, row)]; }
  const vec4& at(int column, int row) const { return pixels[index(column, row)]; }

 private:
  std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(width) + static_cast<std::size_t>(column);
  }
};

/// Encoding of the colours in files of 8 or 16 bits: sRGB (IEC 61966-2-1), which is decoded and encoded, or
/// linear, which is taken as it is. Files of floats are linear, and alpha always is.
enum class Encoding { srgb, linear };

/// Reads any format OpenImageIO knows, up to 16384 pixels a side. One and two channels are grey (and alpha),
/// three get alpha 1. `has_alpha`, if given, tells what the file had. Throws IoError, also for a pixel that
/// is not finite.
DPR_API Image read_image(const std::filesystem::path& file, bool* has_alpha = nullptr,
                         Encoding encoding = Encoding::srgb);

/// Writes by extension: .exr keeps the floats (32 bit, RGBA); .png, .tif, .tiff and .tga clamp to [0, 1] and
/// round to 8 bits; .bmp, .jpg, .jpeg and .ppm do so without alpha. Written to a temporary file that is
/// renamed at the end, so that no half-written file stays behind. Throws IoError, and InvalidArgument for an
/// image without pixels.
DPR_API void write_image(const std::filesystem::path& file, const Image& image,
                         Encoding encoding = Encoding::srgb);

/// The same with alpha 1: for viewers, which would blend colours by the silhouette that were blended already.
DPR_API Image opaque(Image image);

/// Images side by side, with a gap between them (pixels, filled), for strips. Empty in, empty out. Throws
/// InvalidArgument unless all have the same height and the gap is >= 0.
DPR_API Image hstack(const std::vector<Image>& images, int gap = 2, vec4 fill = vec4(1));

/// Images below each other, the first on top, with a gap between them (pixels, filled), for sheets. Empty in,
/// empty out. Throws InvalidArgument unless all have the same width and the gap is >= 0.
DPR_API Image vstack(const std::vector<Image>& images, int gap = 2, vec4 fill = vec4(1));

}  // namespace dpr
