// Test of whether a frame may have faces that cross the near plane or the far one; others are spared the clipping.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "dpr/renderer.hpp"
#include "renderer/depth_range.hpp"
#include "stages/geometry.hpp"

namespace dpr {

class ClipPlanes {
 public:
  ClipPlanes() = default;
  explicit ClipPlanes(std::size_t meshes) : boxes_(meshes), is_known_(meshes, true) {}

  /// The mesh's positions are others than before.
  void move(std::size_t mesh) noexcept {
    boxes_[mesh].reset();
    is_known_[mesh] = true;
  }
  /// The box around the mesh's positions; none: measured when it is first wanted.
  void set_box(std::size_t mesh, const BoxCorners& box) noexcept { boxes_[mesh] = box; }
  /// Only the device knows the mesh's positions; those of views with shapes of their own.
  void forget(std::size_t mesh) noexcept { is_known_[mesh] = false; }
  void forget_views() noexcept { are_views_known_ = false; }
  bool knows(std::size_t mesh) const noexcept { return is_known_[mesh]; }
  bool knows_views() const noexcept { return are_views_known_; }
  std::span<const BoxCorners> boxes_of_views() const noexcept { return boxes_of_views_; }
  /// Boxes for set_boxes_of_views(), of views with shapes of their own, [view][position]. O(positions).
  static std::vector<BoxCorners> boxes_of(std::span<const glm::vec3> positions, const Geometry& geometry);
  /// [view][mesh]; empty: the views share the scene's meshes.
  void set_boxes_of_views(std::vector<BoxCorners>&& boxes) noexcept {
    boxes_of_views_ = std::move(boxes);
    are_views_known_ = true;
  }

  /// False only if every vertex is known to lie between the planes. O(vertices of meshes moved + views *
  /// meshes).
  bool may_be_crossed(const Scene& scene, std::span<const View> views);
  /// The box around a mesh of a view. O(vertices) where it has not been measured.
  const BoxCorners& box_of(const Scene& scene, std::size_t view, std::size_t mesh);

 private:
  std::vector<std::optional<BoxCorners>> boxes_;  // [mesh] object space, of those measured; not of instances
  std::vector<BoxCorners> boxes_of_views_;
  std::vector<bool> is_known_;  // [mesh]
  bool are_views_known_ = true;
};

}  // namespace dpr
