// Sides of triangles that a lens bends.
#pragma once

#include <array>
#include <glm/glm.hpp>

#include "dpr/camera.hpp"

namespace dpr {

/// A camera with a lens, and a place of a mesh before it.
class LensSides {
 public:
  LensSides(const Camera& camera, const glm::mat4& model, int width, int height, double tolerance_pixels);

  /// Adds the sides, k from corner k to the next, of a triangle in object space that have a point drawn
  /// further than the tolerance from where the lens shows it; none of a triangle that is surely not in the
  /// image.
  void find(const std::array<glm::dvec3, 3>& corners, std::array<bool, 3>& is_off) const;

 private:
  struct Segment {
    glm::dvec2 from, to;  // tangents
  };

  /// A tangent further from the axis than this is shown outside of the image.
  double visible_radius(int width, int height) const;
  /// Clips a side in camera space at the near plane; false if nothing is left.
  bool clip(const glm::dvec3& a, const glm::dvec3& b, Segment& clipped) const;
  bool may_be_seen(const std::array<glm::dvec3, 3>& corners) const;
  bool is_off(const Segment& side) const;

  glm::dmat4 to_camera_;
  Distortion distortion_;
  Projection projection_;
  double znear_, zfar_;
  glm::dvec2 pixels_;  // a tangent of one
  double tolerance_;
  double largest_radius_, visible_radius_;
};

}  // namespace dpr
