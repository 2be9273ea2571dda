// Sizes and blurs of the levels, and the options' ranges.
#include "solve/pose_pyramid.hpp"

#include <algorithm>
#include <cmath>

#include "base/checks.hpp"
#include "solve/levenberg_marquardt.hpp"

namespace dpr {

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
  const Image& mask = options.mask;
  if (mask.pixels.empty()) return;
  if (mask.width != scene.width || mask.height != scene.height) {
    throw InvalidArgument("size of the mask (pose)", checks::size(mask.width, mask.height),
                          checks::size(scene.width, scene.height) + ", the scene's");
  }
  checks::require_weights(mask, "mask (pose)", 1, "a number in [0, 1]");
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
