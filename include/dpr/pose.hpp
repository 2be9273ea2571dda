// An object's pose from one image.
#pragma once

#include <functional>
#include <glm/glm.hpp>
#include <optional>
#include <vector>

#include "dpr/adaptive_smoothing.hpp"
#include "dpr/device.hpp"
#include "dpr/image.hpp"
#include "dpr/loss.hpp"
#include "dpr/optimizer.hpp"
#include "dpr/scene.hpp"

namespace dpr {

/// A rigid motion: the object-to-world rotation and translation.
struct Pose {
  glm::dmat3 rotation{1.0};
  glm::dvec3 translation{0.0};
};

/// exp([r]x), and its inverse with an angle in [0, pi].
glm::dmat3 rotation_from_vector(glm::dvec3 r);
glm::dvec3 vector_from_rotation(const glm::dmat3& rotation);
/// The angle between two rotations, degrees, in [0, 180].
double angle_degrees(const glm::dmat3& a, const glm::dmat3& b);

struct PoseOptions {
  unsigned iterations = 300;
  OptimizerOptions optimizer;
  AdaptiveSchedule schedule;
  LossWeights loss = LossWeights::only(LossKind::mse);
  bool solve_translation = false;
};

/// One iteration: the pose it evaluated, and under which smoothing.
struct PoseIteration {
  unsigned iteration = 0;
  double loss = 0;
  float sigma = 0, gamma = 0;
  std::uint32_t samples = 0;
  Pose pose;
};

struct PoseResult {
  Pose pose;        ///< the best of the last smoothing level; losses of different levels are never compared
  double loss = 0;  ///< at that level
  unsigned iterations = 0;
  double seconds = 0;
  std::vector<PoseIteration> history;
};

/// Finds the pose of the scene's only mesh by gradient descent on the loss between render and target.
class PoseSolver {
 public:
  /// Called once an iteration; false stops the solver, which then returns the best so far.
  using Callback = std::function<bool(const PoseIteration&)>;

  /// Throws InvalidArgument if the scene has not exactly one mesh, its transform is singular, or the target's size
  /// differs from the scene's.
  PoseSolver(Device device, Scene scene, const Image& target, PoseOptions options = {});

  /// The pose of the scene's transform: rotation and translation, its scale taken apart.
  Pose scene_pose() const;
  PoseResult solve(const Pose& initial, const Callback& callback = {}) const;

 private:
  Device device_;
  Scene scene_;
  Image target_;
  PoseOptions options_;
  glm::dmat3 stretch_;  ///< what is left of the transform's linear part without its rotation
};

}  // namespace dpr
