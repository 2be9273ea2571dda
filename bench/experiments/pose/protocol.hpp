// The published protocol of the pose experiments: one descent on the rotation vector.
#pragma once

#include <optional>

#include "dpr/adaptive_smoothing.hpp"
#include "dpr/device.hpp"
#include "dpr/image.hpp"
#include "dpr/pose.hpp"
#include "dpr/scene.hpp"

namespace dpr::bench {

/// The constant in the sampled sensitivity to gamma, (58): the noise's dimension d, or the published
/// program's 1. Theirs is d = 51 for every pixel, 50 slots for faces and one for the background.
enum class SensitivityConstant { dimension, one };

/// As published: Adam on the rotation vector, whose learning rate falls with the smoothing, on the mean
/// squared error; fresh noise in every iteration; the pose with the lowest loss of all is the answer.
struct Protocol {
  Smoothing smoothing;  ///< to begin with
  /// Eq. (17)-(18); none: smoothing, samples and learning rate stay. The published program first looks at the
  /// sensitivity after 150 iterations.
  std::optional<AdaptiveSchedule> schedule = AdaptiveSchedule{.start = 149};
  SensitivityConstant sensitivity = SensitivityConstant::dimension;
  unsigned iterations = 800;
};

/// Only the rotation is looked for. The scene's smoothing has no part in it.
PoseResult descend_as_published(const Device& device, const Scene& scene, const Image& target,
                                const Protocol& protocol, const Pose& initial);

/// The same with PerturbedPose instead: noise on the rotation, 0.2 radians to begin with, and rigid
/// images.
PoseResult descend_on_perturbed_pose(const Device& device, const Scene& scene, const Image& target,
                                     const Protocol& protocol, const Pose& initial);

/// The derivative for a rotation vector r, where `gradient` is that for a small rotation applied on the left
/// of exp([r]x): J(r)^T gradient with the left Jacobian J of SO(3) (Sola, Deray & Atchuthan 2018, eq. (145)).
glm::dvec3 rotation_vector_gradient(const glm::dvec3& r, const glm::dvec3& gradient);

}  // namespace dpr::bench
