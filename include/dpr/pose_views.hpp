// An object's poses in several pictures by one camera.
#pragma once

#include <span>
#include <vector>

#include "dpr/pose.hpp"

namespace dpr {

/// Start of a fit in several pictures. scene: the poses that the scene has in front of each view's camera. unknown:
/// none, as of PoseSolver::search().
enum class PoseStart { scene, unknown };

/// Finds the poses of an object that moves between pictures, and with PoseOptions::solve_focal and solve_distortion
/// the focal length and lens of the one camera that took them all: the factor on the views' focal lengths, and what is
/// added to their k1 and k2, are the same for all views, from all pictures together (bundle adjustment, Brown 1976).
/// [view]: focal length and lens are the same in every result, its covariance is that of all unknowns together, less
/// the other views' poses, and empty where the view is not explained and others are. A view's camera says where it
/// stands, and so where the object is in front of it; the scene's camera is not used. Each picture is fitted alone
/// first, then those that are explained together, then the others from what was found. LeastSquares without box, whose
/// mask, silhouette and depth are empty; PoseObservation's weights hold. Throws InvalidArgument for what PoseSolver
/// refuses, and without views.
DPR_API std::vector<PoseResult> solve_moving(const Device& device, const Scene& scene,
                                             std::span<const PoseView> views, const PoseOptions& options,
                                             PoseStart start = PoseStart::scene,
                                             const PoseSolver::Callback& callback = {});

}  // namespace dpr
