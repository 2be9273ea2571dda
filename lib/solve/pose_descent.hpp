// A pose by an optimizer on the exact gradients of the perturbed renderer.
#pragma once

#include "dpr/pose.hpp"

namespace dpr {

/// Throws InvalidArgument for options out of range.
void validate(const Descent& descent, const Scene& scene);

/// Descends from the initial pose, and again from turned ones while the target is not explained. The scene's
/// gradient request is the descent's own business.
PoseResult descend_to_pose(const Device& device, Scene scene, const Image& target, const PoseOptions& options,
                           const Pose& initial, const PoseSolver::Callback& callback);

}  // namespace dpr
