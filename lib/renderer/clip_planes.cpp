#include "renderer/clip_planes.hpp"

#include <algorithm>

namespace dpr {

std::vector<BoxCorners> ClipPlanes::boxes_of(std::span<const glm::vec3> positions, const Geometry& geometry) {
  std::vector<BoxCorners> boxes;
  while (!positions.empty()) {
    for (const MeshRange& mesh : geometry.meshes)
      boxes.push_back(box_corners(positions.subspan(mesh.first_position, mesh.vertices)));
    positions = positions.subspan(geometry.position_count);
  }
  return boxes;
}

const BoxCorners& ClipPlanes::box_of(const Scene& scene, std::size_t view, std::size_t mesh) {
  if (!boxes_of_views_.empty()) return boxes_of_views_[view * boxes_.size() + mesh];
  std::optional<BoxCorners>& box = boxes_[scene.meshes[mesh].instance_of.value_or(mesh)];
  if (!box) box = box_corners(mesh_of(scene, mesh).positions);
  return *box;
}

bool ClipPlanes::may_be_crossed(const Scene& scene, std::span<const View> views) {
  if (!are_views_known_) return true;
  if (boxes_of_views_.empty() && std::ranges::find(is_known_, false) != is_known_.end()) return true;
  for (std::size_t v = 0; v < views.size(); ++v) {
    for (std::size_t m = 0; m < boxes_.size(); ++m) {
      const DepthRange range = depth_range(box_of(scene, v, m), views[v].camera, views[v].transforms[m]);
      if (!is_beyond_near_plane(range, views[v].camera) || !is_before_far_plane(range, views[v].camera))
        return true;
    }
  }
  return false;
}

}  // namespace dpr
