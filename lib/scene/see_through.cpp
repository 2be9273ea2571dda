#include "scene/see_through.hpp"

#include <algorithm>

namespace dpr {

bool is_see_through(const Scene& scene) {
  return std::ranges::any_of(scene.meshes, [](const Instance& i) { return is_see_through(i.mesh); });
}

void require_opaque(const Scene& scene, const std::string& where) {
  for (const Instance& instance : scene.meshes) require_opaque(instance.mesh, where);
}

void require_sees_through(const Smoothing& smoothing) {
  if (smoothing.composition == Composition::joint &&
      smoothing.aggregation_estimator == Estimator::monte_carlo) {
    throw InvalidArgument("aggregation_estimator (smoothing)",
                          "monte_carlo in the joint composition with opacities below 1 or their gradient",
                          "exact, or barrier");
  }
}

}  // namespace dpr
