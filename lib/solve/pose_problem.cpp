// Views as problems of one picture.
#include "solve/pose_problem.hpp"

#include <variant>

#include "base/checks.hpp"
#include "dpr/error.hpp"

namespace dpr {

void require_views(std::span<const PoseView> views, const PoseOptions& options) {
  require(!views.empty(), "views (pose)", views.size(), "at least one");
  const auto* method = std::get_if<LeastSquares>(&options.method);
  if (method == nullptr)
    throw InvalidArgument("method (pose)", "a descent in several views", "least squares");
  if (method->box) throw InvalidArgument("box (pose)", "one beside views", "none");
  for (const Image* image : {&method->mask, &method->silhouette.image, &method->depth.image}) {
    if (!image->pixels.empty())
      throw InvalidArgument("images of the method (pose)", "one beside views", "none: each view has its own");
  }
}

PoseProblem problem_of(const PoseView& view, const Scene& scene, const PoseOptions& options) {
  PoseProblem problem{scene, view.target, options};
  problem.scene.camera = view.camera;
  auto& method = std::get<LeastSquares>(problem.options.method);
  method.mask = view.mask;
  method.silhouette.image = view.silhouette;
  method.depth.image = view.depth;
  return problem;
}

}  // namespace dpr
