#include "cli/target.hpp"

#include <algorithm>

#include "base/checks.hpp"
#include "dpr/error.hpp"

namespace dpr::cli {

std::string named(const char* option, const std::string& file) {
  return std::string(option) + " " + file + " (command line)";
}

void require_size(const Image& image, glm::ivec2 size, const std::string& name) {
  if (image.width == size.x && image.height == size.y) return;
  throw InvalidArgument("size of " + name, checks::size(image.width, image.height),
                        checks::size(size.x, size.y) + ", the scene's");
}

bool has_silhouette(const Image& image) {
  return std::ranges::any_of(image.pixels, [](const glm::vec4& p) { return p.a < 1; });
}

Image read_target(const std::string& file, const LossWeights& weights, Encoding encoding, PixelFacts& facts) {
  Image target = read_image(file, encoding, facts);
  if (weights.silhouette > 0 && !has_silhouette(target)) {
    throw InvalidArgument(named("--target", file), "no alpha, or 1 everywhere",
                          "an image whose alpha is the silhouette, such as an .exr of dpr render");
  }
  return target;
}

Image read_target(const std::string& file, const LossWeights& weights, Encoding encoding,
                  const Scene& scene) {
  PixelFacts facts;
  Image target = read_target(file, weights, encoding, facts);
  require_size(target, {scene.width, scene.height}, named("--target", file));
  return target;
}

}  // namespace dpr::cli
