// The point about which an object turns while its pose is looked for.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "dpr/pose.hpp"
#include "dpr/scene.hpp"

namespace dpr {

/// A scene whose object turns about the middle of its bounding box: a mesh may lie far from its origin, about which a
/// rotation would throw it out of the picture. Poses are translated between the two.
class PosePivot {
 public:
  /// Without a translation to look for the object turns about its origin: poses stay as they are.
  PosePivot(const Scene& scene, const PoseOptions& options);

  const Scene& scene() const { return scene_; }
  Pose to_middle(const Pose& pose) const { return {pose.rotation, pose.translation + pose.rotation * arm_}; }
  Pose to_origin(const Pose& pose) const { return {pose.rotation, pose.translation - pose.rotation * arm_}; }
  /// The same of the covariance of a pose about the middle; nothing of an empty one.
  void to_origin(const Pose& pose, std::vector<double>& covariance) const;

 private:
  Scene scene_;
  glm::dvec3 arm_{0.0};  ///< from the origin to the middle, world lengths, object axes
};

}  // namespace dpr
