// Depths of the boxes around meshes before cameras: the bounds that are known of a mesh before its vertices
// are projected.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <span>

#include "dpr/camera.hpp"
#include "dpr/voxels.hpp"

namespace dpr {

/// The corners of the box around points, of which there must be some.
using BoxCorners = std::array<glm::dvec3, 8>;
BoxCorners box_corners(std::span<const glm::vec3> points);
BoxCorners box_corners(const Bounds& box);

/// Depths between which all that lies in a box has its own, but for rounding.
struct DepthRange {
  double nearest, furthest;
};
DepthRange depth_range(const BoxCorners& box, const Camera& camera, const glm::mat4& model);

/// True if no rounding of single precision takes anything of the box to the near plane; or to the far plane.
bool is_beyond_near_plane(const DepthRange& range, const Camera& camera);
bool is_before_far_plane(const DepthRange& range, const Camera& camera);

}  // namespace dpr
