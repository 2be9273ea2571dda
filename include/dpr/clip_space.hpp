// Positions in clip space as vertices in front of a camera.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "dpr/camera.hpp"
#include "dpr/export.h"
#include "dpr/vectors.hpp"

namespace dpr {

/// Positions (x, y, z, w) in OpenGL's clip space, of shapes of as many vertices each, as vertices in front of a
/// camera that shows the same: for callers who multiply by projection matrices themselves. The camera is that of all
/// shapes, at the origin.
///
/// Where projection matrices made them, z is a w + b. Then w serves as depth, the camera is a pinhole, and triangles
/// may reach behind it. Otherwise z / w + 2 serves as depth in front of an orthographic camera, which needs all w above
/// 0; the weights of its samples' corners are linear on the screen. Both clip where OpenGL's near plane does at the
/// latest.
///
/// Images are the same with noise on the pixel. Other noise has gamma relative to the camera's planes, which are this
/// one's. Depths and positions that are shown are those of these vertices, and so would lights have to be.
class DPR_API ClipSpace {
 public:
  /// positions: [shape][vertex]. faces: of every shape; vertices that none of them has may lie anywhere; without
  /// faces all count. width, height: of the images, pixels. O(positions). Throws InvalidArgument for positions that
  /// are not finite or no rows of so many shapes, indices beyond them, and where neither camera will do.
  ClipSpace(std::span<const vec4> positions, std::size_t shapes, std::span<const uvec3> faces, int width,
            int height);

  bool is_perspective() const { return !camera_.orthographic_height; }
  /// For Scene::camera or every View. Its planes enclose what is to be seen.
  const Camera& camera() const { return camera_; }
  /// [shape] of a pinhole camera, the factor of x, y and w, which changes no image. Others have 1.
  std::span<const float> scales() const { return scales_; }

  /// [shape][vertex], for Mesh::positions or Renderer::set_shapes(), of the constructor's positions: make another
  /// ClipSpace of positions that have moved, whose planes and scales are others.
  std::vector<vec3> vertices(std::span<const vec4> positions) const;
  /// From the gradients of these vertices to those of the positions.
  std::vector<vec4> gradient(std::span<const vec4> positions, std::span<const vec3> grad_vertices) const;

 private:
  void require_size(std::size_t count, const char* name) const;

  Camera camera_;
  std::vector<float> scales_;
  std::vector<bool> used_;  // [vertex]
  float aspect_;            // width / height
};

}  // namespace dpr
