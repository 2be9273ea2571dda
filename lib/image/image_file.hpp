// Image files, with what they say of their pixels.
#pragma once

#include <filesystem>

#include "dpr/image.hpp"
#include "image/codec.hpp"

namespace dpr {

/// As the public read_image().
Image read_image(const std::filesystem::path& file, Encoding encoding, PixelFacts& facts);

}  // namespace dpr
