// The part of the images in which an object is looked for.
#pragma once

#include "solve/pose_problem.hpp"

namespace dpr {

/// Throws InvalidArgument for a box that holds nothing of the scene's images.
void validate_box(const PoseBox& box, const Scene& scene);

/// The problem in the pixels about a box alone: none is further away than a quarter of the larger side of the box. The
/// box of the options, if there is one, moves along. The camera must be a perspective one.
PoseProblem cut_to_box(const Scene& scene, const Image& target, const PoseOptions& options,
                       const PoseBox& box);

}  // namespace dpr
