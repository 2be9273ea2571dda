// A pose by least squares: many hypotheses, from coarse to fine.
#pragma once

#include <span>

#include "dpr/pose.hpp"

namespace dpr {

/// From the initial poses and the options' rotations together. Of equally good poses the one nearest to the
/// first initial pose is the result; with `anywhere`, the one of the smallest loss, and the initial pose only
/// gives the translation.
PoseResult fit_pose(const Device& device, const Scene& scene, const Image& target, const PoseOptions& options,
                    std::span<const Pose> initial, bool anywhere, const PoseSolver::Callback& callback);

}  // namespace dpr
