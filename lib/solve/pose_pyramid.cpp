// Sizes and blurs of the levels, and the options' ranges.
#include "solve/pose_pyramid.hpp"

#include <algorithm>
#include <cmath>

#include "base/checks.hpp"
#include "solve/levenberg_marquardt.hpp"

namespace dpr {

namespace {

bool is_empty(const Image& image) { return image.pixels.empty(); }

void validate_depth(const Image& depth) {
  if (std::ranges::none_of(depth.pixels, has_depth)) {
    throw InvalidArgument(
        "depth (pose)", "no pixel that has one",
        "distances along the camera's axis in the first channel; 0 or NaN where there is none");
  }
  for (const glm::vec4& pixel : depth.pixels) {
    if (has_depth(pixel))
      require(pixel.x > 0, "depth (pose)", pixel.x, "a distance along the camera's axis, or 0 for none");
  }
}

}  // namespace

bool has_observations(const LeastSquares& options) {
  return !is_empty(options.silhouette.image) || !is_empty(options.depth.image);
}

bool has_depth(const glm::vec4& pixel) {
  return pixel.w > 0 && pixel.x != 0 && std::isfinite(pixel.x) && std::isfinite(pixel.w);
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
    validate_depth(options.depth.image);
  }
  for (const PoseObservation* observation : {&options.silhouette, &options.depth}) {
    require(observation->weight >= 0 && std::isfinite(observation->weight), "weight (pose)",
            observation->weight, "a finite number, at least 0");
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

unsigned most_iterations(const LeastSquares& options, const Scene& scene) {
  const auto levels = static_cast<unsigned>(level_shapes(scene, options).size());
  const unsigned again = options.light == PoseLight::fixed ? 0 : levels - 1;  // in another light
  return k_patience * options.iterations * (levels + again);
}

}  // namespace dpr
