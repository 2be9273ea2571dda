// The image of --target.
#pragma once

#include <string>

#include "dpr/image.hpp"
#include "dpr/image_loss.hpp"
#include "dpr/scene.hpp"
#include "image/codec.hpp"

namespace dpr::cli {

/// "--target FILE (command line)": what messages call an option's file.
std::string named(const char* option, const std::string& file);

/// Throws InvalidArgument where an image that messages call `name` has another size than the scene's.
void require_size(const Image& image, glm::ivec2 size, const std::string& name);

/// True if a pixel has an alpha below 1.
bool has_silhouette(const Image& image);

/// An image to compare renders with, of any size. Throws IoError, and InvalidArgument where silhouettes are to be
/// compared and the file shows none (it has no alpha, or 1 everywhere).
Image read_target(const std::string& file, const LossWeights& weights, Encoding encoding, PixelFacts& facts);

/// The same; throws InvalidArgument where its size is not the scene's.
Image read_target(const std::string& file, const LossWeights& weights, Encoding encoding, const Scene& scene);

}  // namespace dpr::cli
