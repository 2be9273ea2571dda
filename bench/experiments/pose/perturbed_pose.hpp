// The perturbed optimizer around the whole renderer: noise on the pose of a mesh and of the camera instead of
// on distances and depths.
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "dpr/device.hpp"
#include "dpr/image.hpp"
#include "dpr/image_loss.hpp"
#include "dpr/renderer.hpp"
#include "dpr/scene.hpp"
#include "dpr/vectors.hpp"

namespace dpr::bench {

/// One number for each parameter that can be perturbed: its noise's scale, or a derivative for it. Rotations
/// are vectors r applied on the left of a matrix' linear part, A <- exp([r]x) A, in radians, the translation
/// column left alone, as in PoseGradient; translations are added to that column.
struct PoseParameters {
  dvec3 mesh_rotation{0.0}, mesh_translation{0.0};      ///< of object to world
  dvec3 camera_rotation{0.0}, camera_translation{0.0};  ///< of world to camera
  double fov_y_degrees = 0;
  std::array<double, 4> intrinsics{};  ///< fx, fy, cx, cy in pixels
};

struct PerturbedPoseOptions {
  /// >= 0; what is 0 is not perturbed and has no gradient. d is the number of the others.
  PoseParameters scale{.mesh_rotation = dvec3(0.1), .mesh_translation = dvec3(0.1)};
  Prior prior = Prior::gaussian;  ///< any but uniform, whose density has no score
  std::uint32_t samples = 64;     ///< M, 1 to 4096: rigid renders of a batch
  /// Control variate subtracted from a loss: nothing, the loss of the unperturbed pose, eq. (14), or the mean
  /// loss of the samples that are independent of it.
  VarianceReduction variance_reduction = VarianceReduction::leave_one_out;
  /// Stratified: a Latin hypercube, each parameter's marginal split in `samples` strata of equal probability
  /// (McKay, Beckman & Conover 1979).
  Draws draws = Draws::antithetic;
  std::size_t mesh = 0;  ///< which mesh of the scene mesh_rotation and mesh_translation move
  LossWeights loss = LossWeights::only(LossKind::mse);
};

/// Estimates of F(theta) = E[L(theta + scale Z)] and its derivatives, each with its standard error. The
/// errors are those of independent samples, or of independent pairs; for stratified draws they are upper
/// bounds (Owen 1997: a Latin hypercube's variance is at most M / (M - 1) times that of independent samples).
/// They are 0 where there is a single sample or pair.
struct PerturbedPoseResult {
  double loss = 0, loss_error = 0;
  PoseParameters gradient, gradient_error;
  /// dF/dc of a common factor c of all scales at c = 1: by how much the loss rises as the noise grows.
  double sensitivity = 0, sensitivity_error = 0;
  unsigned dimensions = 0;  ///< d
};

/// L is the loss of the rigid image, piecewise constant in the pose: it has no useful gradient. Its
/// expectation under noise has one, by eq. (11), (14) and (15) with d-dimensional noise:
///
///   F            = 1/M sum_m L_m
///   dF/dtheta_k  = 1/M sum_m (L_m - baseline_m) nu'(Z_mk) / scale_k
///   dF/dc        = 1/M sum_m (L_m - baseline_m) (sum_k nu'(Z_mk) Z_mk - d)
///
/// Costs M forward passes in one batch and no backward pass; its variance grows with d, not with the number
/// of triangles.
class PerturbedPose {
 public:
  /// The scene's smoothing has no part in it. Throws InvalidArgument for a scene that cannot be rendered, a
  /// target of another size, scales that are negative, not finite, all 0, or of camera parameters the scene's
  /// camera does not have (field of view beside intrinsics), a mesh that is not there, a number of samples
  /// out of range or odd for pairs; and for what has no unbiased estimator: the uniform prior, antithetic
  /// draws of an asymmetric prior, leave-one-out with fewer than two independent samples or pairs, and with
  /// stratified draws, which all depend on each other.
  PerturbedPose(Device device, const Scene& scene, const Image& target, const PerturbedPoseOptions& options);
  ~PerturbedPose();
  PerturbedPose(PerturbedPose&&) noexcept;
  PerturbedPose& operator=(PerturbedPose&&) noexcept;

  /// The scene's own camera and transforms.
  const View& scene_view() const;
  /// The estimates around a view. The noise is a pure function of seed, sample and parameter. A perturbed
  /// field of view or focal length that no camera can have is replaced by the nearest that one can. Throws
  /// InvalidArgument for a view that does not fit the scene.
  PerturbedPoseResult evaluate(const View& view, std::uint64_t seed);

  /// Scales may be changed between two evaluations, e.g. to anneal them; the same parameters must be
  /// perturbed.
  void set_scale(const PoseParameters& scale);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The view moved by a step in its parameters, e.g. one of an optimizer.
View moved(const View& view, std::size_t mesh, const PoseParameters& step);

}  // namespace dpr::bench
