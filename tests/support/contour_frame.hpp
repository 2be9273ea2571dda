// Meshes given directly in NDC and view depth, through the stages that look for contours and blend across
// them.
#pragma once

#include <vector>

#include "stages/antialias.hpp"
#include "stages/contour.hpp"
#include "stages/setup.hpp"
#include "support/probe.hpp"

namespace dpr::test {

/// The vertices at the ends of an edge.
inline glm::uvec2 ends_of(const cl_uint2& edge, const std::vector<glm::uvec3>& faces) {
  const cl_uint side = edge.s[0] & ~(DPR_EDGE_FLAG | DPR_EDGE_SEAM);
  const glm::uvec3& face = faces[side / 3];
  const int corner = static_cast<int>(side % 3);
  return {face[corner], face[(corner + 1) % 3]};
}

/// One view of one mesh, whose positions are x, y in NDC and z the view depth.
class ContourFrame {
 public:
  ContourFrame(const Mesh& mesh, int width, int height)
      : geometry(device_impl(), scene_of(mesh)),
        transform(device_impl()),
        setup(device_impl()),
        edges(device_impl(), scene_of(mesh)),
        contour(device_impl()),
        antialias(device_impl()) {
    p.views = p.meshes = 1;
    p.vertices = static_cast<cl_uint>(geometry.vertices);
    p.normals = p.vertices;
    p.faces = static_cast<cl_uint>(geometry.faces);
    p.color_faces = static_cast<cl_uint>(geometry.color_faces);
    p.width = static_cast<cl_uint>(width);
    p.height = static_cast<cl_uint>(height);
    p.tiles_x = (p.width + DPR_TILE - 1) / DPR_TILE;
    p.tiles_y = (p.height + DPR_TILE - 1) / DPR_TILE;
    p.pixel_size = 2.0F / static_cast<float>(std::min(width, height));
    p.perspective_correct = 1;
    shared::ViewParams camera{};
    camera.znear = 1;
    camera.zfar = 100;
    camera.inverse_range = 1.0F / 99;
    views.cameras.upload(device_impl(), std::span(&camera, 1));
    const float none = 0;
    hidden_.upload(device_impl(), std::span(&none, 1));
    place(mesh.positions);
  }

  /// Moves the vertices.
  void place(const std::vector<glm::vec3>& positions) {
    std::vector<cl_float4> values;
    for (const glm::vec3& v : positions) values.push_back({{v.x, v.y, v.z, 0.0F}});
    transform.ndc.upload(device_impl(), values);
    transform.world.upload(device_impl(), values);
    geometry.positions.upload(device_impl(), values);
    edges.join(p, geometry);
  }

  /// Sets the faces up as they are now.
  ContourInputs inputs() {
    Buffer<cl_uint> tile_counts;
    setup.forward(p, views, geometry, transform.ndc, hidden_, tile_counts);
    set_edges(p, edges, shading, depth_reach);
    return {p,
            views,
            geometry,
            edges,
            transform,
            setup.facing,
            clipped,
            geometry.face_vertices,
            geometry.color_values};
  }

  std::size_t samples() const { return std::size_t{p.width} * p.height; }

  shared::FrameParams p{};
  DeviceViews views;
  Geometry geometry;
  Transform transform;
  Setup setup;
  Buffer<shared::ClippedFace> clipped;
  Edges edges;
  std::optional<Shading> shading;
  float depth_reach = 0;
  Contour contour;
  Antialias antialias;

 private:
  static Scene scene_of(const Mesh& mesh) {
    Scene scene;
    scene.smoothing = smoothing_preset("gaussian");
    scene.meshes.push_back({mesh});
    return scene;
  }

  Buffer<float> hidden_;
};

}  // namespace dpr::test
