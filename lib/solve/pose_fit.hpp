// A pose by least squares.
#pragma once

#include <span>

#include "solve/pose_light.hpp"
#include "solve/pose_problem.hpp"

namespace dpr {

/// A pose that was found, and in which terms it explains the target.
struct FittedPose {
  PoseResult result;
  CornerNormals normals = CornerNormals::parted;
  float color_scale = 0;  ///< of the robust loss; 0: squares
  int samples = 1;        ///< of a pixel's side, whose mean is compared
  double baseline_part =
      1;  ///< least loss of what explains nothing, in parts of that of a picture without object
};

/// Knowledge of the pose before a fit.
enum class Foreknowledge {
  place,  ///< the first initial pose gives the translation alone; the pose of the smallest loss is the result
  start,  ///< the result is the nearest to the first initial pose of those that are equally good
  pose  ///< the same; the rotation is nearly right, so that light has directions at meshes that stand still too
};

/// Fits from the initial poses and the options' rotations together, in one picture or in several, whose scenes differ in
/// their cameras and whose options in their images.
FittedPose fit_pose(const Device& device, std::span<const PoseProblem> pictures,
                    std::span<const Pose> initial, Foreknowledge known, const PoseSolver::Callback& callback);
FittedPose fit_pose(const Device& device, const Scene& scene, const Image& target, const PoseOptions& options,
                    std::span<const Pose> initial, Foreknowledge known, const PoseSolver::Callback& callback);

}  // namespace dpr
