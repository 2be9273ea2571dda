#include "scene/triangles_in_view.hpp"

#include <algorithm>
#include <vector>

#include "mesh/mesh_facts.hpp"

namespace dpr {
namespace {

/// The edges of a scene's image.
class ImageEdges {
 public:
  explicit ImageEdges(const Scene& scene)
      : camera_(scene.camera),
        projection_(projection(scene.camera, scene.width, scene.height)),
        half_(glm::vec2(scene.width, scene.height) /
              static_cast<float>(std::min(scene.width, scene.height))) {}

  /// True if three points in view space lie beyond one of them. A lens' images leave nothing out.
  bool leaves_out(const glm::vec3& a, const glm::vec3& b, const glm::vec3& c) const {
    if (camera_.distortion) return false;
    for (int axis = 0; axis < 2; ++axis) {
      for (const float sign : {-1.0F, 1.0F}) {
        const auto is_beyond = [&](const glm::vec3& p) {
          const float divisor = camera_.orthographic_height ? 1.0F : -p.z;
          return sign * (projection_.scale[axis] * p[axis] + projection_.offset[axis] * divisor) >
                 half_[axis] * divisor;
        };
        if (is_beyond(a) && is_beyond(b) && is_beyond(c)) return true;
      }
    }
    return false;
  }

 private:
  const Camera& camera_;
  Projection projection_;
  glm::vec2 half_;  ///< NDC
};

}  // namespace

TrianglesInView triangles_in_view(const Scene& scene, std::size_t entry) {
  const Mesh& mesh = mesh_of(scene, entry);
  const glm::mat4 to_view = scene.camera.view * scene.meshes[entry].transform;
  std::vector<glm::vec3> points;
  points.reserve(mesh.positions.size());
  for (const glm::vec3& p : mesh.positions) points.emplace_back(to_view * glm::vec4(p, 1));
  const ImageEdges edges(scene);
  TrianglesInView counts;
  for (const glm::uvec3& face : mesh.faces) {
    const glm::vec3 &a = points[face.x], &b = points[face.y], &c = points[face.z];
    const auto [low, high] = std::minmax({-a.z, -b.z, -c.z});
    if (!has_area(mesh, face)) {
      ++counts.without_area;
    } else if (high < scene.camera.znear) {
      ++counts.near;
    } else if (low >= scene.camera.zfar) {
      ++counts.far;
    } else if (edges.leaves_out(a, b, c)) {
      ++counts.outside;
    } else if (low < scene.camera.znear || high > scene.camera.zfar) {
      ++counts.clipped;
    }
  }
  return counts;
}

}  // namespace dpr
