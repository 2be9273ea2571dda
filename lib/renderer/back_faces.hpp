// Faces that nothing can see, because they are the far side of a solid.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "dpr/renderer.hpp"
#include "mesh/solid.hpp"
#include "renderer/clip_planes.hpp"

namespace dpr {

class BackFaces {
 public:
  BackFaces() = default;
  /// `solids` are those of the scene's meshes, or of views with faces of their own.
  explicit BackFaces(std::vector<Solid> solids);

  /// The mesh's positions are others than before.
  void move(std::size_t mesh) noexcept;
  /// Only the device knows them: all faces may be seen.
  void forget(std::size_t mesh) noexcept;

  /// Finds how the faces of meshes that have moved wind. That of large meshes of one part is the device's to measure, by
  /// the sign of their volume: it is called for these. O(faces of the others).
  void measure(const Scene& scene, const std::function<void(std::size_t mesh)>& measure_on_device);
  /// True if the device has measured a mesh.
  bool are_on_device() const;
  /// [view][mesh] how the faces wind of views' own shapes, as Solid::winding() has it; 0 of large meshes. O(faces).
  std::vector<int> windings_of(const Scene& scene, const Geometry& geometry,
                               std::span<const glm::vec3> positions) const;
  /// [view][mesh] the orientation in NDC, +1 or -1, of faces that cannot be seen; 0: all may be. They may not
  /// where the mesh bounds a solid that lies wholly behind the near plane, thicker by far than the depth
  /// (normalised) by which the noise of the depths shows what lies behind. Where a mesh passes through itself
  /// such that its inside is outside, its far side is seen there. Meshes that the device measures count as
  /// counter-clockwise. `of_shapes` are windings_of() views with shapes of their own, or none.
  std::vector<float> hidden(const Scene& scene, std::span<const View> views, ClipPlanes& clip_planes,
                            float depth_reach, std::span<const int> of_shapes) const;

 private:
  struct State {
    Solid solid;
    bool is_measured = false, is_on_device = false;
    int winding = 0;
  };
  static float hidden_of(int winding, const BoxCorners& box, const Camera& camera, const glm::mat4& model,
                         float depth_reach);

  std::vector<State> states_;  // [mesh]; not of instances, which have their mesh's
};

}  // namespace dpr
