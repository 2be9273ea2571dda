// The image of --target.
#pragma once

#include <string>

#include "dpr/image.hpp"
#include "dpr/image_loss.hpp"

namespace dpr::cli {

/// The image to compare a render with. Throws IoError, and InvalidArgument where silhouettes are to be
/// compared and the file shows none: it has no alpha, or 1 everywhere.
Image read_target(const std::string& file, const LossWeights& weights, Encoding encoding);

}  // namespace dpr::cli
