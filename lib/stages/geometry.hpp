// The scene's geometry on the device: all meshes in one set of buffers, with what gathers gradients without
// atomics.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "device/buffer.hpp"
#include "dpr/scene.hpp"
#include "shared_types.h"

namespace dpr {

/// Corners (row * 3 + corner) by what they refer to, in order: a compressed sparse row. Vertices of views with faces
/// of their own are by [view][vertex].
struct Incidence {
  Buffer<cl_uint> starts;   ///< [target + 1]
  Buffer<cl_uint> corners;  ///< [row * 3]
  /// Where a target has more corners than one work-item is to add: runs of at most DPR_RUN_CHUNK of them, [part + 1],
  /// and the targets' runs of these, [target + 1].
  Buffer<cl_uint> part_starts, parts;
  std::size_t part_count = 0;

  std::size_t bytes() const {
    return starts.capacity_bytes() + corners.capacity_bytes() + part_starts.capacity_bytes() +
           parts.capacity_bytes();
  }
};

/// Ranges of a mesh in the joined buffers. An instance has vertices, and as many given normals, of its own;
/// the rest is its mesh's.
struct MeshRange {
  std::size_t first_vertex = 0, vertices = 0;
  std::size_t first_position = 0, first_color = 0, colors = 0;
  std::size_t first_texcoord = 0, texcoords = 0;  // of textured meshes
  std::size_t first_texture = 0;
  std::size_t first_normal = 0, normals = 0;  // of meshes that give some: their values
  std::size_t first_material = 0, materials = 1;
  std::size_t first_opacity = 0;
};

/// The textures of all meshes, and where faces look into them. Empty where no mesh has any.
struct Textures {
  std::size_t texcoords = 0, texels = 0;
  std::vector<shared::Texture> list;  ///< [texture]

  Buffer<cl_float4> texcoord_values;  ///< [texcoord] u, v
  Buffer<shared::Texture> textures;   ///< `list`
  Buffer<cl_float4> texel_values;     ///< [texel] of every level
  /// The same in the first component, 1 of textures without. Empty where no texture has any.
  Buffer<cl_float4> opacities;
  bool has_levels = false;  ///< the smaller levels are those of the largest
  Incidence texcoord_corners;

  bool empty() const { return list.empty(); }
  bool has_opacities() const { return opacities.size() > 0; }
  /// True if some have smaller levels.
  bool has_pyramids() const {
    return std::ranges::any_of(list, [](const shared::Texture& t) { return t.levels > 1; });
  }
  std::size_t bytes() const;
};

/// The normals that meshes give, and where corners look: into those of the vertices, then these. Empty where
/// no mesh gives any. Instances' are counted among them, but have their mesh's values.
struct GivenNormals {
  std::size_t count = 0;
  Buffer<cl_float4> values;  ///< [value] object space
  Buffer<cl_uint> mesh;      ///< [given]
  Incidence corners;         ///< by vertex, then by given normal

  bool empty() const { return count == 0; }
  std::size_t bytes() const;
};

/// The materials of all meshes, at least one of each.
struct SurfaceMaterials {
  std::size_t count = 0;
  Buffer<cl_float4> values;  ///< [material] RGB of the specular coefficient; w = shininess, or 0
  Buffer<cl_uint> faces;     ///< [face] in the order of their materials
  Buffer<cl_uint> starts;    ///< [material + 1] of `faces`

  std::size_t bytes() const;
};

/// The opacities of all meshes' vertices or faces, one of each mesh without, and where corners look into them. Empty
/// where no mesh has any.
struct Opacities {
  Buffer<cl_float4> values;  ///< [opacity] in the first component
  Incidence corners;

  std::size_t bytes() const;
};

struct Geometry {
  /// `views_of_faces`: see Renderer::Impl::set_scene().
  Geometry(Device::Impl& device, const Scene& scene, std::size_t views_of_faces = 1);

  std::size_t views_of_faces;
  std::size_t vertices = 0, position_count = 0, faces = 0, colors = 0;  ///< `faces` of a view
  std::vector<MeshRange> meshes;                                        ///< instances among them

  Buffer<cl_float4> positions;       ///< [position] object space
  Buffer<shared::MeshPlace> places;  ///< [mesh]
  Buffer<cl_uint> vertex_mesh;       ///< [vertex]
  /// [row], the faces, of views with faces of their own view after view: vertex indices; w = mesh. Then, where they are
  /// others, and each from its place on: indices of the corners' colours, w = material; of their texture coordinates,
  /// w = texture or DPR_NO_TEXTURE; of their normals: a vertex, or the number of vertices + a given one; of their
  /// opacities.
  Buffer<cl_uint4> face_vertices;
  std::size_t color_faces = 0, texcoord_faces = 0, normal_faces = 0, opacity_faces = 0;
  Buffer<cl_float4> color_values;                 ///< [color]
  Buffer<cl_float4> view_positions, view_colors;  ///< [view][position], [view][color]: of views' own
  Incidence vertex_corners;
  Textures textures;
  GivenNormals given_normals;
  SurfaceMaterials materials;
  Opacities opacities;

  bool has_own_faces() const { return views_of_faces > 1; }
  /// Faces of all views that have some of their own.
  std::size_t rows() const { return views_of_faces * faces; }
  const Incidence& normal_corners() const {
    return given_normals.empty() ? vertex_corners : given_normals.corners;
  }
  std::size_t normals() const { return vertices + given_normals.count; }
  /// Positions that the kernels read with the frame's strides.
  const Buffer<cl_float4>& positions_of(const shared::FrameParams& p) const {
    return p.position_stride != 0 ? view_positions : positions;
  }
  const Buffer<cl_float4>& colors_of(const shared::FrameParams& p) const {
    return p.color_stride != 0 ? view_colors : color_values;
  }

  /// The corners of every colour. Where all meshes have colours of vertices, those are numbered as the
  /// vertices are.
  const Incidence& color_corners() const { return color_faces == 0 ? vertex_corners : color_corners_; }

  std::size_t bytes() const;

 private:
  void add_places(Device::Impl& device, const Scene& scene);
  /// These add to `all_faces`, which becomes `face_vertices`.
  void add_colors(Device::Impl& device, const Scene& scene, std::vector<cl_uint4>& all_faces);
  void add_textures(Device::Impl& device, const Scene& scene, std::vector<cl_uint4>& all_faces);
  void add_normals(Device::Impl& device, const Scene& scene, std::vector<cl_uint4>& all_faces);
  void add_opacities(Device::Impl& device, const Scene& scene, std::vector<cl_uint4>& all_faces);
  void add_materials(Device::Impl& device, const Scene& scene);

  Incidence color_corners_;  // where colours are not numbered as the vertices are
};

/// True if a mesh of the scene has textures.
bool is_textured(const Scene& scene);

/// Among the mesh's materials; 0 where it has none.
std::size_t material_of(const Mesh& mesh, std::size_t face);

/// True if a mesh of the scene gives normals.
bool gives_normals(const Scene& scene);

/// True if a mesh of the scene has materials of its own.
bool has_materials(const Scene& scene);

/// A vector of three in the first components; w = 0.
cl_float4 to_cl(const glm::vec3& v);
std::vector<cl_float4> to_cl(std::span<const glm::vec3> vectors);
/// As SurfaceMaterials has it.
cl_float4 to_cl(const Material& material);

/// Writes a part of a buffer of vectors. Blocks.
void write_range(Device::Impl& device, const Buffer<cl_float4>& buffer, std::size_t first,
                 std::span<const cl_float4> values);

}  // namespace dpr
