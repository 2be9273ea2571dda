// The meshes of a scene that a pose moves as one rigid body.
#pragma once

#include <cstddef>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "dpr/pose.hpp"
#include "dpr/renderer.hpp"
#include "dpr/scene.hpp"

namespace dpr {

/// A mesh of a body: a point p of it is R (linear p + offset) + t in the world where the body's pose is R, t.
struct BodyPart {
  std::size_t mesh;  ///< entry of Scene::meshes
  glm::dmat3 linear;
  glm::dvec3 offset;
};

/// The parts keep the places that they have in the scene relative to the first of them, whose pose is the body's. The
/// scene's other meshes stand still.
class PoseBody {
 public:
  /// `meshes`: entries of Scene::meshes; none: the first. The first one's transform must be invertible.
  PoseBody(const Scene& scene, std::span<const std::size_t> meshes);

  const std::vector<BodyPart>& parts() const { return parts_; }
  const BodyPart& first() const { return parts_.front(); }
  /// True if no mesh stands still.
  bool is_alone() const { return parts_.size() == transforms_.size(); }

  /// In the scene.
  const Pose& pose() const { return pose_; }
  /// Object to world of all meshes of the scene where the body has a pose.
  std::vector<glm::mat4> transforms(const Pose& pose) const;
  /// Moves the body in a scene of the same meshes.
  void place(Scene& scene, const Pose& pose) const;
  /// Derivatives of these by a turn about an axis of the world, and by a shift.
  std::vector<PoseGradient> turning(const Pose& pose, const glm::dvec3& axis) const;
  std::vector<PoseGradient> shifting(const glm::dvec3& shift) const;
  /// Gradient by the body's pose, from those by the meshes' transforms.
  PoseGradient gradient(const Pose& pose, std::span<const PoseGradient> transforms) const;

  /// Vertices about the body's origin, world lengths, the body's axes. `scene`: the one that it was made of.
  std::vector<glm::dvec3> points(const Scene& scene) const;

 private:
  Pose pose_;
  std::vector<BodyPart> parts_;
  std::vector<glm::mat4> transforms_;
};

}  // namespace dpr
