#include "cli/target.hpp"

#include <algorithm>

#include "base/checks.hpp"
#include "dpr/error.hpp"

namespace dpr::cli {

Image read_target(const std::string& file, const LossWeights& weights, Encoding encoding,
                  const Scene& scene) {
  Image target = read_image(file, nullptr, encoding);
  if (target.width != scene.width || target.height != scene.height) {
    throw InvalidArgument("size of --target " + file + " (command line)",
                          checks::size(target.width, target.height),
                          checks::size(scene.width, scene.height) + ", the scene's");
  }
  const bool shows_silhouette = std::ranges::any_of(target.pixels, [](const auto& p) { return p.a < 1; });
  if (weights.silhouette > 0 && !shows_silhouette) {
    throw InvalidArgument("--target " + file + " (command line)", "no alpha, or 1 everywhere",
                          "an image whose alpha is the silhouette, such as an .exr of dpr render");
  }
  return target;
}

}  // namespace dpr::cli
