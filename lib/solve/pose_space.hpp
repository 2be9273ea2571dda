// The parameters a pose solver turns, and in which units.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "dpr/pose.hpp"
#include "dpr/renderer.hpp"
#include "solve/pose_body.hpp"

namespace dpr {

/// The unknowns: a pose, a factor on the camera's focal length, and offsets of the lens' k1 and k2.
struct Hypothesis {
  Pose pose;
  double focal_scale = 1;
  glm::dvec2 radial{0.0};

  bool operator==(const Hypothesis& other) const {
    return pose.rotation == other.pose.rotation && pose.translation == other.pose.translation &&
           focal_scale == other.focal_scale && radial == other.radial;
  }
};

/// Steps in the tangent space at a hypothesis: a rotation vector on the left (radians); then, if asked for,
/// the translation along the camera's axes; then the logarithm of the focal length; then k1 and k2.
class PoseSpace {
 public:
  static constexpr std::size_t k_most_parameters = 9;
  using Step = std::array<double, k_most_parameters>;
  using Matrix = std::array<double, k_most_parameters * k_most_parameters>;  ///< [size()][size()], row-major

  /// `initial` tells how far away the object is.
  PoseSpace(const Scene& scene, const Pose& initial, const PoseOptions& options);

  /// The same parameters, along the same axes, with the sizes that things have in that scene's camera.
  PoseSpace seen_by(const Scene& scene) const;

  std::size_t size() const { return size_; }
  Hypothesis moved(const Hypothesis& from, const Step& step) const;
  /// Change of each parameter that moves the object's rim by a fraction `ndc` of the image.
  Step step_lengths(double ndc) const;
  /// The greatest of the steps' lengths over those that move the rim by 1 NDC.
  double length(const Step& step) const;
  /// The same between two hypotheses, rotation and translation counted.
  double distance(const Hypothesis& a, const Hypothesis& b) const;
  View view(const Hypothesis& hypothesis, const Camera& camera) const;
  /// How that view changes with a parameter.
  ViewGradient view_tangent(const Hypothesis& hypothesis, const Camera& camera, std::size_t parameter) const;
  /// The body behind the camera: the other meshes alone are seen.
  Hypothesis absent(const Camera& camera) const;
  /// Poses all around at the initial place, before the camera's lens, and such as may be found where one is
  /// looked for: what faces are cut for. None without a lens.
  std::vector<View> seen_through_lenses(const Camera& camera) const;
  /// World axes instead of the camera's: row-major [size][size] of a covariance of steps.
  std::vector<double> to_world(std::span<const double> covariance) const;

  const PoseBody& body() const { return body_; }
  const glm::dmat3& camera_axes() const { return camera_axes_; }  ///< columns, in the world
  double radius() const { return radius_; }                       ///< of the object about its origin, world
  /// True if the pixels that have a depth may be those of the object alone: they are no more than its sphere could cover
  /// where it begins, and but for stray ones none is further from there along the axis than its radius; or where a
  /// translation is looked for than its diameter from the median of them, and no more than it could cover there.
  bool may_cover(const Image& depths) const;
  double radius_ndc() const { return radius_ndc_; }
  /// World lengths of 1 NDC at a distance along the camera's axis, in relation to those at the object.
  double relative_distance(double distance) const { return is_perspective_ ? distance / distance_ : 1; }

 private:
  void look(const Scene& scene);

  PoseBody body_;
  glm::dmat3 camera_axes_;
  glm::dvec3 initial_translation_;
  bool translation_, focal_, distortion_, is_perspective_;
  std::size_t focal_index_, radial_index_, size_;  // where their parameters begin, and how many there are
  double radius_;
  double distance_ = 0, radius_ndc_ = 0;  // in the camera
  double rim_ = 0;                        // the largest tangent at which the object is seen, about
  double ndc_per_tangent_ = 0;
};

}  // namespace dpr
