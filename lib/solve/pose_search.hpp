// A pose by least squares: many hypotheses, from coarse to fine.
#pragma once

#include <span>

#include "dpr/pose.hpp"
#include "solve/pose_light.hpp"

namespace dpr {

/// A pose that was found, and in which terms it explains the target.
struct FittedPose {
  PoseResult result;
  CornerNormals normals = CornerNormals::parted;
  float color_scale = 0;  ///< of the robust loss; 0: squares
  double baseline_part =
      1;  ///< least loss of what explains nothing, in parts of that of a picture without object
};

/// From the initial poses and the options' rotations together. Of equally good poses the one nearest to the
/// first initial pose is the result; with `anywhere`, the one of the smallest loss, and the initial pose only
/// gives the translation.
FittedPose fit_pose(const Device& device, const Scene& scene, const Image& target, const PoseOptions& options,
                    std::span<const Pose> initial, bool anywhere, const PoseSolver::Callback& callback);

}  // namespace dpr
