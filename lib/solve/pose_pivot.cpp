// Poses about the object's middle.
#include "solve/pose_pivot.hpp"

#include "mesh/bounding_box.hpp"
#include "solve/polar.hpp"
#include "solve/pose_scatter.hpp"

namespace dpr {

Pose pose_of(const Scene& scene) {
  const glm::dmat4 transform(scene.meshes.front().transform);
  return {polar_decomposition(glm::dmat3(transform)).rotation, glm::dvec3(transform[3])};
}

PosePivot::PosePivot(const Scene& scene, bool solves_translation) : scene_(scene) {
  Instance& object = scene_.meshes.front();
  const glm::vec3 middle = center(bounding_box(object.mesh.positions));
  if (!solves_translation || middle == glm::vec3(0)) return;
  arm_ = polar_decomposition(glm::dmat3(object.transform)).stretch * glm::dvec3(middle);
  for (glm::vec3& p : object.mesh.positions) p -= middle;
  object.transform[3] = object.transform * glm::vec4(middle, 1);
}

void PosePivot::to_origin(const Pose& pose, std::vector<double>& covariance) const {
  if (!covariance.empty() && arm_ != glm::dvec3(0)) move_pivot(-(pose.rotation * arm_), covariance);
}

}  // namespace dpr
