#include "cli/target.hpp"

#include <algorithm>

#include "base/checks.hpp"
#include "dpr/error.hpp"
#include "image/codec.hpp"

namespace dpr::cli {
namespace {

std::string named(const char* option, const std::string& file) {
  return std::string(option) + " " + file + " (command line)";
}

void require_size(const Image& image, const Scene& scene, const std::string& name) {
  if (image.width == scene.width && image.height == scene.height) return;
  throw InvalidArgument("size of " + name, checks::size(image.width, image.height),
                        checks::size(scene.width, scene.height) + ", the scene's");
}

bool has_silhouette(const Image& image) {
  return std::ranges::any_of(image.pixels, [](const glm::vec4& p) { return p.a < 1; });
}

}  // namespace

Image read_target(const std::string& file, const LossWeights& weights, Encoding encoding,
                  const Scene& scene) {
  Image target = read_image(file, nullptr, encoding);
  require_size(target, scene, named("--target", file));
  if (weights.silhouette > 0 && !has_silhouette(target)) {
    throw InvalidArgument(named("--target", file), "no alpha, or 1 everywhere",
                          "an image whose alpha is the silhouette, such as an .exr of dpr render");
  }
  return target;
}

Image read_silhouette(const std::string& file, const Scene& scene) {
  Image image = read_image(file, nullptr, Encoding::linear);
  require_size(image, scene, named("--silhouette", file));
  if (has_silhouette(image)) {
    for (glm::vec4& pixel : image.pixels) pixel = glm::vec4(pixel.a);
  }
  return image;
}

Image read_depth(const std::string& file, std::optional<float> scale, const Scene& scene) {
  PixelFacts facts;
  Image image = read_pixels(file, facts);
  require_size(image, scene, named("--depth", file));
  if (!facts.floats && !scale) {
    throw InvalidArgument(named("--depth", file), "whole numbers",
                          "--depth-scale, the length of a 1 in the scene's units, or a file of floats");
  }
  for (glm::vec4& pixel : image.pixels)
    pixel = glm::vec4(glm::vec3(pixel.x * facts.largest * scale.value_or(1.0F)), pixel.w);
  return image;
}

}  // namespace dpr::cli
