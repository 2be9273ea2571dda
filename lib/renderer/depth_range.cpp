#include "renderer/depth_range.hpp"

#include <algorithm>
#include <limits>

#include "mesh/bounding_box.hpp"

namespace dpr {

BoxCorners box_corners(std::span<const glm::vec3> points) { return box_corners(bounding_box(points)); }

BoxCorners box_corners(const Bounds& box) {
  BoxCorners corners;
  for (unsigned corner = 0; corner < corners.size(); ++corner) {
    corners[corner] = {(corner & 1U) != 0 ? box.high.x : box.low.x,
                       (corner & 2U) != 0 ? box.high.y : box.low.y,
                       (corner & 4U) != 0 ? box.high.z : box.low.z};
  }
  return corners;
}

DepthRange depth_range(const BoxCorners& box, const Camera& camera, const glm::mat4& model) {
  const glm::dmat4 to_view = glm::dmat4(camera.view) * glm::dmat4(model);
  DepthRange range{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  for (const glm::dvec3& corner : box) {
    const double depth = -(to_view * glm::dvec4(corner, 1)).z;
    range.nearest = std::min(range.nearest, depth);
    range.furthest = std::max(range.furthest, depth);
  }
  return range;
}

namespace {

constexpr double k_rounding = 1e-5;  // of the depth

}  // namespace

bool is_beyond_near_plane(const DepthRange& range, const Camera& camera) {
  return range.nearest > static_cast<double>(camera.znear) + k_rounding * range.furthest;
}

bool is_before_far_plane(const DepthRange& range, const Camera& camera) {
  return range.furthest < (1 - k_rounding) * static_cast<double>(camera.zfar);
}

}  // namespace dpr
