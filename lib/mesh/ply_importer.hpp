// Importer through which OpenMesh's PLY reader writes straight into a mesh.
//
// OpenMesh's own importer fills a halfedge mesh: it refuses faces that would make an edge non-manifold, or
// adds them again with copies of their vertices. This one records vertices and polygons in the order of the
// file, so that soup stays soup and the indices stay those of the file.
#pragma once

#include <OpenMesh/Core/IO/importer/BaseImporter.hh>
#include <cstddef>
#include <glm/glm.hpp>
#include <vector>

#include "mesh/mesh_reader.hpp"

namespace dpr {

class PlyImporter final : public OpenMesh::IO::BaseImporter {
 public:
  using VertexHandle = OpenMesh::VertexHandle;
  using HalfedgeHandle = OpenMesh::HalfedgeHandle;
  using EdgeHandle = OpenMesh::EdgeHandle;
  using FaceHandle = OpenMesh::FaceHandle;

  std::vector<glm::vec3> positions, vertex_colors;
  std::vector<glm::uvec3> triangles;  // indices as the file has them: they may be out of range
  std::vector<glm::vec3> polygon_colors;
  std::vector<std::size_t> polygon_ends;     // [polygon] how many triangles there are with its own
  std::optional<std::size_t> short_polygon;  // the last one with fewer than three corners

  VertexHandle add_vertex(const OpenMesh::Vec3f& point) override {
    positions.emplace_back(point[0], point[1], point[2]);
    kernel_.resize(positions.size(), polygon_ends.size());
    return VertexHandle(static_cast<int>(positions.size() - 1));
  }
  VertexHandle add_vertex() override { return add_vertex(OpenMesh::Vec3f(0, 0, 0)); }
  void set_point(VertexHandle v, const OpenMesh::Vec3f& point) override {
    positions[index(v)] = {point[0], point[1], point[2]};
  }
  FaceHandle add_face(const VHandles& corners) override {
    if (corners.size() < 3) short_polygon = polygon_ends.size();
    corners_.clear();
    for (const VertexHandle corner : corners) corners_.push_back(static_cast<std::uint32_t>(corner.idx()));
    append_fan(corners_, triangles);
    polygon_ends.push_back(triangles.size());
    kernel_.resize(positions.size(), polygon_ends.size());
    return FaceHandle(static_cast<int>(polygon_ends.size() - 1));
  }

  void set_color(VertexHandle v, const OpenMesh::Vec4uc& c) override {
    append_color(glm::vec3(c[0], c[1], c[2]) / 255.0F, index(v), index(v) + 1, vertex_colors);
  }
  void set_color(FaceHandle f, const OpenMesh::Vec4uc& c) override {
    append_color(glm::vec3(c[0], c[1], c[2]) / 255.0F, index(f), index(f) + 1, polygon_colors);
  }

  size_t n_vertices() const override { return positions.size(); }
  size_t n_faces() const override { return polygon_ends.size(); }
  size_t n_edges() const override { return 0; }

  /// Custom properties go here; a reader that finds a list needs one even if nobody looks at it.
  OpenMesh::BaseKernel* kernel() override { return &kernel_; }

  // The rest of what a file may hold is of no use here.
  void set_color(VertexHandle, const OpenMesh::Vec3uc&) override {}
  void set_color(VertexHandle, const OpenMesh::Vec3f&) override {}
  void set_color(VertexHandle, const OpenMesh::Vec4f&) override {}
  void set_color(FaceHandle, const OpenMesh::Vec3uc&) override {}
  void set_color(FaceHandle, const OpenMesh::Vec3f&) override {}
  void set_color(FaceHandle, const OpenMesh::Vec4f&) override {}
  HalfedgeHandle add_edge(VertexHandle, VertexHandle) override { return HalfedgeHandle(); }
  FaceHandle add_face(HalfedgeHandle) override { return FaceHandle(); }
  void add_face_texcoords(FaceHandle, VertexHandle, const std::vector<OpenMesh::Vec2f>&) override {}
  void add_face_texcoords(FaceHandle, VertexHandle, const std::vector<OpenMesh::Vec3f>&) override {}
  void set_face_texindex(FaceHandle, int) override {}
  void set_halfedge(VertexHandle, HalfedgeHandle) override {}
  void set_normal(VertexHandle, const OpenMesh::Vec3f&) override {}
  void set_normal(VertexHandle, const OpenMesh::Vec3d&) override {}
  void set_normal(FaceHandle, const OpenMesh::Vec3f&) override {}
  void set_normal(FaceHandle, const OpenMesh::Vec3d&) override {}
  void set_texcoord(VertexHandle, const OpenMesh::Vec2f&) override {}
  void set_texcoord(HalfedgeHandle, const OpenMesh::Vec2f&) override {}
  void set_texcoord(VertexHandle, const OpenMesh::Vec3f&) override {}
  void set_texcoord(HalfedgeHandle, const OpenMesh::Vec3f&) override {}
  void set_status(VertexHandle, const OpenMesh::Attributes::StatusInfo&) override {}
  void set_status(HalfedgeHandle, const OpenMesh::Attributes::StatusInfo&) override {}
  void set_status(EdgeHandle, const OpenMesh::Attributes::StatusInfo&) override {}
  void set_status(FaceHandle, const OpenMesh::Attributes::StatusInfo&) override {}
  void set_next(HalfedgeHandle, HalfedgeHandle) override {}
  void set_face(HalfedgeHandle, FaceHandle) override {}
  void request_face_texcoords2D() override {}
  void set_color(EdgeHandle, const OpenMesh::Vec3uc&) override {}
  void set_color(EdgeHandle, const OpenMesh::Vec4uc&) override {}
  void set_color(EdgeHandle, const OpenMesh::Vec3f&) override {}
  void set_color(EdgeHandle, const OpenMesh::Vec4f&) override {}
  void add_texture_information(int, std::string) override {}

 private:
  // Properties without a mesh: as many as there are vertices and faces.
  class Kernel final : public OpenMesh::BaseKernel {
   public:
    void resize(std::size_t vertices, std::size_t faces) {
      if (vertices != vertices_) vprops_resize(vertices);
      if (faces != faces_) fprops_resize(faces);
      vertices_ = vertices;
      faces_ = faces;
    }
    size_t n_vertices() const override { return vertices_; }
    size_t n_faces() const override { return faces_; }

   private:
    std::size_t vertices_ = 0, faces_ = 0;
  };

  static std::size_t index(OpenMesh::BaseHandle handle) { return static_cast<std::size_t>(handle.idx()); }

  std::vector<std::uint32_t> corners_;  // of the polygon that arrives
  Kernel kernel_;
};

}  // namespace dpr
