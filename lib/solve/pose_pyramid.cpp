// Sizes and blurs of the levels, and the options' ranges.
#include "solve/pose_pyramid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/checks.hpp"
#include "solve/levenberg_marquardt.hpp"
#include "solve/pose_window.hpp"
#include "solve/resample.hpp"

namespace dpr {

namespace {

bool is_empty(const Image& image) { return image.pixels.empty(); }

/// Some depth lies in the camera's range: a wrong unit shows here.
void validate_depth(const Image& depth, const Camera& camera) {
  float nearest = std::numeric_limits<float>::infinity(), furthest = -nearest;
  bool is_in_range = false;
  for (const glm::vec4& pixel : depth.pixels) {
    if (!has_depth(pixel)) continue;
    nearest = std::min(nearest, pixel.x);
    furthest = std::max(furthest, pixel.x);
    is_in_range = is_in_range || (pixel.x >= camera.znear && pixel.x <= camera.zfar);
  }
  if (nearest > furthest) {
    throw InvalidArgument(
        "depth (pose)", "no pixel that has one",
        "distances along the camera's axis in the first channel; 0 or NaN where there is none");
  }
  require(nearest > 0, "depth (pose)", nearest, "a distance along the camera's axis, or 0 for none");
  if (!is_in_range) {
    throw InvalidArgument("depth (pose)", checks::text(nearest) + " to " + checks::text(furthest),
                          "some from znear to zfar, " + checks::text(camera.znear) + " to " +
                              checks::text(camera.zfar) + ", in the scene's units");
  }
}

}  // namespace

bool has_observations(const LeastSquares& options) {
  return !is_empty(options.silhouette.image) || !is_empty(options.depth.image);
}

void require_size(const Image& image, const Scene& scene, const std::string& name) {
  if (image.width == scene.width && image.height == scene.height) return;
  throw InvalidArgument("size of the " + name + " (pose)", checks::size(image.width, image.height),
                        checks::size(scene.width, scene.height) + ", the scene's");
}

void validate(const LeastSquares& options, const Scene& scene) {
  constexpr unsigned k_most_rotations = 1U << 24;
  require(options.rotations <= k_most_rotations, "rotations (pose)", options.rotations, "at most 2^24");
  require(options.coarsest > 0, "coarsest (pose)", options.coarsest, "at least 1");
  require(options.iterations > 0, "iterations (pose)", options.iterations, "at least 1");
  checks::require_enumerator(options.noise, Noise::pixel, "noise (pose)");
  checks::require_enumerator(options.light, PoseLight::harmonics, "light (pose)");
  require(options.blur > 0 && std::isfinite(options.blur), "blur (pose)", options.blur,
          "a finite number above 0");
  require(options.blur_end > 0 && std::isfinite(options.blur_end), "blur_end (pose)", options.blur_end,
          "a finite number above 0");
  require(options.robust_scale >= 0 && std::isfinite(options.robust_scale), "robust_scale (pose)",
          options.robust_scale, "a finite number, at least 0");
  const auto validate_weights = [&](const Image& image, const char* name, const char* expected) {
    if (is_empty(image)) return;
    require_size(image, scene, name);
    checks::require_weights(image, checks::in(name, "pose"), 1, expected);
  };
  validate_weights(options.mask, "mask", "a number in [0, 1]");
  validate_weights(options.silhouette.image, "silhouette", "a coverage in [0, 1]");
  if (!is_empty(options.depth.image)) {
    require_size(options.depth.image, scene, "depth");
    validate_depth(options.depth.image, scene.camera);
  }
  const auto validate_factor = [](float weight, const char* name) {
    require(weight >= 0 && std::isfinite(weight), name, weight, "a finite number, at least 0");
  };
  validate_factor(options.silhouette.weight, "silhouette_weight (pose)");
  validate_factor(options.depth.weight, "depth_weight (pose)");
  if (options.box) validate_box(*options.box, scene);
  if (options.unknown_background && !options.robust)
    throw InvalidArgument("unknown_background (pose)", "a loss that is not robust", "a robust one");
  if (options.unknown_background && !is_empty(options.silhouette.image)) {
    throw InvalidArgument("unknown_background (pose)", "a silhouette, which tells the background apart",
                          "one of the two");
  }
}

std::vector<LevelShape> level_shapes(const Scene& scene, const LeastSquares& options) {
  const int full = std::min(scene.width, scene.height);
  std::vector<LevelShape> shapes{{full, options.blur}};
  while (static_cast<unsigned>(shapes.front().short_side / 2) >= options.coarsest) {
    shapes.insert(shapes.begin(), {(shapes.front().short_side + 1) / 2, options.blur});
  }
  shapes.push_back({full, options.blur_end});
  return shapes;
}

int most_samples(const Scene& scene) {
  // Less than a quarter of a pixel matters little, and large images show the pose without.
  constexpr int k_samples = 4, k_most_image_samples = 1 << 18;
  const double pixels = static_cast<double>(scene.width) * scene.height;
  int side = k_samples;
  while (side > 1 && pixels * side * side > k_most_image_samples) --side;
  return side;
}

unsigned most_iterations(const LeastSquares& options, const Scene& scene) {
  const auto levels = static_cast<unsigned>(level_shapes(scene, options).size());
  const unsigned again = options.light == PoseLight::fixed ? 0 : levels - 1;  // in another light
  return k_patience * options.iterations * (levels + again);
}

}  // namespace dpr
