// The images of --target, --silhouette and --depth.
#pragma once

#include <optional>
#include <string>

#include "dpr/image.hpp"
#include "dpr/image_loss.hpp"
#include "dpr/scene.hpp"

namespace dpr::cli {

/// The image to compare a render with. Throws IoError, and InvalidArgument where silhouettes are to be
/// compared and the file shows none (it has no alpha, or 1 everywhere), or where its size is not the scene's.
Image read_target(const std::string& file, const LossWeights& weights, Encoding encoding, const Scene& scene);

/// The coverage of pixels by an object, in the first channel: the file's alpha where that is below 1 somewhere, or else
/// its first channel. Throws IoError, and InvalidArgument where its size is not the scene's.
Image read_silhouette(const std::string& file, const Scene& scene);

/// Distances along the camera's axis in the first channel, in the scene's units, of a file's first channel.
/// `scale`: what a 1 of the file is, whose whole numbers are taken as they are, not as parts of the largest.
/// Throws as above, and where a file of whole numbers has no scale.
Image read_depth(const std::string& file, std::optional<float> scale, const Scene& scene);

}  // namespace dpr::cli
