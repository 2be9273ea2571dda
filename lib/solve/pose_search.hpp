// A pose among many hypotheses, from coarse to fine.
#pragma once

#include <span>

#include "solve/pose_fit.hpp"
#include "solve/pose_places.hpp"

namespace dpr {

/// Searches from the initial poses and the places together, in one picture or in several, whose scenes differ in their
/// cameras and whose options in their images. The object turns about its origin.
FittedPose search_pose(const Device& device, std::span<const PoseProblem> pictures,
                       std::span<const Pose> initial, const PosePlaces& places, Foreknowledge known,
                       const PoseSolver::Callback& callback);

}  // namespace dpr
