// The levels of the search for a pose, as its options have them.
#pragma once

#include <vector>

#include "dpr/pose.hpp"
#include "solve/pose_level.hpp"

namespace dpr {

/// Throws InvalidArgument for options out of range; the mask must have the scene's size.
void validate(const LeastSquares& options, const Scene& scene);

/// From coarse to fine: the resolution doubles; the last level is the finest once more, with the final blur.
std::vector<LevelShape> level_shapes(const Scene& scene, const LeastSquares& options);

/// Through all levels.
unsigned most_iterations(const LeastSquares& options, const Scene& scene);

}  // namespace dpr
