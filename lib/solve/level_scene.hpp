// The scene that a level of the pose solver's pyramid renders.
#pragma once

#include "dpr/pose.hpp"
#include "dpr/scene.hpp"
#include "solve/pose_space.hpp"

namespace dpr {

struct LevelShape {
  int short_side;   ///< of its images, in pixels
  float blur;       ///< of the edges, in samples
  int samples = 1;  ///< on a pixel's side; their mean over the pixel's area is what it shows
};

/// The scene at a level's size, with the solver's own smoothing. Below the full size its mesh and its
/// textures are no finer than the pixels. Without a fixed light it has no lights, over black.
Scene level_scene(const Scene& scene, const PoseSpace& space, const LeastSquares& options,
                  const LevelShape& shape, PoseLight light);

}  // namespace dpr
