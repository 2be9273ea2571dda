// Objects put together from closed solids: what the families of shapes are made of.
#pragma once

#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "dpr/mesh.hpp"

namespace dpr::learn {

enum class Axis { x, y, z };

/// A cross-section of a loft: where along the axis, and its centre and half extents in the other two
/// coordinates, in the order x, y, z.
struct Section {
  float at;
  glm::vec2 center, half;
};

/// A mesh with face colours that grows by closed, outward-oriented solids; they may overlap.
class Solids {
 public:
  void box(const glm::vec3& center, const glm::vec3& half, const glm::vec3& color);
  /// Round, along an axis.
  void cylinder(Axis axis, const glm::vec3& center, float half_length, float radius, const glm::vec3& color);
  void ellipsoid(const glm::vec3& center, const glm::vec3& half, const glm::vec3& color);
  /// Through cross-sections with `sides` corners: rectangles if 4, else inscribed in ellipses. At least two
  /// sections, of positive extents, `at` rising.
  void loft(Axis axis, std::span<const Section> sections, unsigned sides, const glm::vec3& color);

  /// Moved and scaled so that the box about it is centred, no side is longer than `side`, and its diagonal
  /// not longer than `diagonal`.
  Mesh fitted(float side, float diagonal) const;

 private:
  Mesh mesh_;
};

}  // namespace dpr::learn
