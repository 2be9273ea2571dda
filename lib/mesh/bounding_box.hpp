// The box around points.
#pragma once

#include <glm/glm.hpp>
#include <span>

#include "dpr/voxels.hpp"

namespace dpr {

/// The smallest axis-aligned box that holds the points, of which there must be some.
inline Bounds bounding_box(std::span<const glm::vec3> points) {
  Bounds box{points.front(), points.front()};
  for (const glm::vec3& p : points) {
    box.low = glm::min(box.low, p);
    box.high = glm::max(box.high, p);
  }
  return box;
}

inline glm::vec3 center(const Bounds& box) { return 0.5F * (box.low + box.high); }

}  // namespace dpr
