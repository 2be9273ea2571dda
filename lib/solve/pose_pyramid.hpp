// The levels of the search for a pose, as its options have them.
#pragma once

#include <string>
#include <vector>

#include "dpr/pose.hpp"
#include "solve/pose_level.hpp"

namespace dpr {

/// Throws InvalidArgument for options out of range; images must have the scene's size.
void validate(const LeastSquares& options, const Scene& scene);
/// Throws InvalidArgument for an image of another size than the scene's.
void require_size(const Image& image, const Scene& scene, const std::string& name);

/// True if there is a silhouette or a depth.
bool has_observations(const LeastSquares& options);

/// From coarse to fine: the resolution doubles; the last level is the finest once more, with the final blur.
std::vector<LevelShape> level_shapes(const Scene& scene, const LeastSquares& options);

/// Samples of a pixel whose mean may be compared, on its side.
int most_samples(const Scene& scene);

/// Through all levels.
unsigned most_iterations(const LeastSquares& options, const Scene& scene);

}  // namespace dpr
