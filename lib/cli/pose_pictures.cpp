#include "cli/pose_pictures.hpp"

#include <algorithm>
#include <cmath>

#include "base/checks.hpp"
#include "cli/target.hpp"
#include "dpr/error.hpp"
#include "image/codec.hpp"
#include "scene/scene_json.hpp"
#include "solve/resample.hpp"

namespace dpr::cli {
namespace {

glm::ivec2 picture_size(const Image& image) { return {image.width, image.height}; }

std::string size_text(glm::ivec2 size) { return checks::size(size.x, size.y); }

Image scaled_depth(Image depth, glm::ivec2 size) {
  constexpr float k_most = 0.5F;  // of a pixel's area
  for (glm::vec4& pixel : depth.pixels) pixel.w = has_depth(pixel) ? 1 : 0;
  depth = resample_medians(depth, size.x, size.y);
  for (glm::vec4& pixel : depth.pixels) pixel = pixel.w >= k_most ? glm::vec4(pixel.x) : glm::vec4(0);
  return depth;
}

Image scaled_mask(Image mask, glm::ivec2 size) {
  for (glm::vec4& pixel : mask.pixels) pixel.w = 1;
  return resample_medians(mask, size.x, size.y);
}

void require_same_shape(const Image& image, const Scene& scene, const std::string& name) {
  const glm::ivec2 size(scene.width, scene.height);
  if (have_same_shape(picture_size(image), size)) return;
  std::string expected = size_text(size) + ", the scene's, or another size of that shape";
  if (scene.camera.intrinsics) {
    expected += "; the intrinsics hold for the scene's width and height";
  } else {
    const auto width = std::lround(static_cast<double>(size.y) * image.width / image.height);
    expected += "; --size " + size_text({std::max(1L, width), size.y}) +
                ", or a scene without width and height, has the picture's shape";
  }
  throw InvalidArgument("size of " + name, size_text(picture_size(image)), expected);
}

}  // namespace

glm::ivec2 ObservedPictures::size() const {
  for (const Image* image : {&target, &silhouette})
    if (!image->pixels.empty()) return picture_size(*image);
  return picture_size(depth);
}

Image read_silhouette(const std::string& file) {
  Image image = read_image(file, nullptr, Encoding::linear);
  if (has_silhouette(image)) {
    for (glm::vec4& pixel : image.pixels) pixel = glm::vec4(pixel.a);
  }
  return image;
}

Image read_depth(const std::string& file, std::optional<float> scale) {
  if (scale) checks::require_positive(*scale, "--depth-scale (command line)");
  PixelFacts facts;
  Image image = read_pixels(file, facts);
  if (!facts.floats && !scale) {
    throw InvalidArgument(named("--depth", file), "whole numbers",
                          "--depth-scale, the length of a 1 in the scene's units, or a file of floats");
  }
  for (glm::vec4& pixel : image.pixels)
    pixel = glm::vec4(glm::vec3(pixel.x * facts.largest * scale.value_or(1.0F)), pixel.w);
  return image;
}

ObservedPictures read_pictures(const PosePictureFiles& files, const LossWeights& weights, Encoding encoding) {
  if (files.depth_scale && files.depth.empty())
    throw InvalidArgument("--depth-scale (command line)", "no --depth", "the file whose unit it is");
  if (files.target.empty() && files.silhouette.empty() && files.depth.empty()) {
    throw InvalidArgument("--target (command line)", "none",
                          "an image that shows the pose, or --silhouette, or --depth");
  }
  ObservedPictures pictures;
  if (!files.target.empty()) {
    PixelFacts facts;
    pictures.target = read_target(files.target, weights, encoding, facts);
    pictures.focal_35mm = facts.focal_35mm;
  }
  if (!files.mask.empty()) pictures.mask = read_image(files.mask, nullptr, Encoding::linear);
  if (!files.silhouette.empty()) pictures.silhouette = read_silhouette(files.silhouette);
  if (!files.depth.empty()) pictures.depth = read_depth(files.depth, files.depth_scale);
  return pictures;
}

void scale_pictures(ObservedPictures& pictures, const PosePictureFiles& files, const Scene& scene,
                    Notes& notes) {
  const glm::ivec2 size(scene.width, scene.height);
  const auto fit = [&](Image& image, const char* option, const std::string& file, auto scaled) {
    if (image.pixels.empty() || picture_size(image) == size) return;
    require_same_shape(image, scene, named(option, file));
    notes.push_back(file + " is scaled from " + size_text(picture_size(image)) + " to " + size_text(size) +
                    ", the scene's; --size takes another");
    image = scaled(std::move(image), size);
  };
  const auto mean = [](const Image& image, glm::ivec2 to) { return resample(image, to.x, to.y); };
  fit(pictures.target, "--target", files.target, mean);
  fit(pictures.silhouette, "--silhouette", files.silhouette, mean);
  fit(pictures.mask, "--mask", files.mask, scaled_mask);
  fit(pictures.depth, "--depth", files.depth, scaled_depth);
}

}  // namespace dpr::cli
