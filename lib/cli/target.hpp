// The image of --target.
#pragma once

#include <string>

#include "dpr/image.hpp"
#include "dpr/image_loss.hpp"
#include "dpr/scene.hpp"

namespace dpr::cli {

/// The image to compare a render with. Throws IoError, and InvalidArgument where silhouettes are to be
/// compared and the file shows none (it has no alpha, or 1 everywhere), or where its size is not the scene's.
Image read_target(const std::string& file, const LossWeights& weights, Encoding encoding, const Scene& scene);

}  // namespace dpr::cli
