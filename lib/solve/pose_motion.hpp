// What the poses of the last frames say of the next.
#pragma once

#include "dpr/pose.hpp"

namespace dpr {

/// Constant velocity, damped: a turn about the world's axes and a shift from frame to frame, of which a part is expected
/// again.
class PoseMotion {
 public:
  /// At rest; `damping` in [0, 1] is the part.
  PoseMotion(const Pose& pose, double damping) : last_(pose), guess_(pose), damping_(damping) {}

  /// The pose to expect in the next frame.
  Pose next() const;
  /// The object was followed to this pose in the next frame.
  void follow(const Pose& pose);
  /// It was lost in the next frame: the motion fades.
  void miss();
  /// It is here, and at rest as far as is known.
  void restart(const Pose& pose) { *this = PoseMotion(pose, damping_); }

  const Pose& last() const { return last_; }    ///< that was found
  const Pose& guess() const { return guess_; }  ///< of the last frame, found or not

 private:
  Pose last_, guess_;
  glm::dvec3 turn_{0.0}, shift_{0.0};  // rotation vector, radians a frame; world lengths a frame
  double damping_;
};

}  // namespace dpr
