// An object's pose from one image.
#pragma once

#include <functional>
#include <glm/glm.hpp>
#include <variant>
#include <vector>

#include "dpr/adaptive_smoothing.hpp"
#include "dpr/annealed_smoothing.hpp"
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
  unsigned iterations = 200;
  OptimizerOptions optimizer;
  /// How the scene's smoothing shrinks: from coarse to fine in fixed steps, or as the paper's schedule has
  /// it.
  std::variant<AnnealSchedule, AdaptiveSchedule> schedule;
  LossWeights loss = LossWeights::only(LossKind::mse);
  bool solve_translation = false;
  /// Further descents, each from a rotation turned away from the initial one, as long as the target is not
  /// explained: as long as the loss is above that part of the initial pose's loss, both under the finest
  /// smoothing reached.
  unsigned restarts = 6;
  float explained = 0.1F;  ///< in (0, 1)
};

/// One iteration: the pose it evaluated, and under which smoothing.
struct PoseIteration {
  unsigned iteration = 0;  ///< counted through all descents
  unsigned descent = 0;    ///< 0, or the number of the restart
  double loss = 0;
  float sigma = 0, gamma = 0;
  std::uint32_t samples = 0;
  Pose pose;
};

struct PoseResult {
  /// The best of the last smoothing level of the best descent; losses of different levels are never compared.
  Pose pose;
  double loss = 0;          ///< at the finest level
  unsigned iterations = 0;  ///< of all descents
  unsigned descent = 0;     ///< the one that found the pose
  bool explained = false;   ///< the loss fell below PoseOptions::explained of the initial pose's
  double seconds = 0;
  std::vector<PoseIteration> history;
};

/// Finds the pose of the scene's only mesh by gradient descent on the loss between render and target.
class PoseSolver {
 public:
  /// Called once an iteration; false stops the solver, which then returns the best so far.
  using Callback = std::function<bool(const PoseIteration&)>;

  /// Throws InvalidArgument if the scene has not exactly one mesh, its transform is singular, or the target's
  /// size differs from the scene's.
  PoseSolver(Device device, Scene scene, const Image& target, PoseOptions options = {});

  /// The pose of the scene's transform: rotation and translation, its scale taken apart.
  Pose scene_pose() const;
  /// Throws InvalidArgument if the initial rotation is none.
  PoseResult solve(const Pose& initial, const Callback& callback = {}) const;

 private:
  Device device_;
  Scene scene_;
  Image target_;
  PoseOptions options_;
  glm::dmat3 stretch_;  ///< what is left of the transform's linear part without its rotation
};

}  // namespace dpr
