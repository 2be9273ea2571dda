// Poses carried on.
#include "solve/pose_motion.hpp"

namespace dpr {

Pose PoseMotion::next() const {
  return {rotation_from_vector(damping_ * turn_) * guess_.rotation, guess_.translation + damping_ * shift_};
}

void PoseMotion::follow(const Pose& pose) {
  turn_ = vector_from_rotation(pose.rotation * glm::transpose(last_.rotation));
  shift_ = pose.translation - last_.translation;
  last_ = guess_ = pose;
}

void PoseMotion::miss() {
  guess_ = next();
  turn_ *= damping_;
  shift_ *= damping_;
}

}  // namespace dpr
