// What a pose is looked for in.
#pragma once

#include <span>

#include "dpr/pose.hpp"

namespace dpr {

/// A scene, its target and its observations.
struct PoseProblem {
  Scene scene;
  Image target;
  PoseOptions options;
};

/// Throws InvalidArgument where there are no views, and for options that hold for a single picture.
void require_views(std::span<const PoseView> views, const PoseOptions& options);

/// The scene in a view's camera, with what was observed in it; the method must be least squares.
PoseProblem problem_of(const PoseView& view, const Scene& scene, const PoseOptions& options);

}  // namespace dpr
