// The scene's geometry on the device: all meshes in one set of buffers, with what gathers gradients without
// atomics.
#pragma once

#include <span>
#include <vector>

#include "device/buffer.hpp"
#include "dpr/scene.hpp"
#include "shared_types.h"

namespace dpr {

/// Corners (face * 3 + corner) by what they refer to, in order: a compressed sparse row.
struct Incidence {
  Buffer<cl_uint> starts;   ///< [target + 1]
  Buffer<cl_uint> corners;  ///< [face * 3]
};

/// Where a mesh lies in the joined buffers.
struct MeshRange {
  std::size_t first_vertex, vertices, first_color, colors;
};

struct Geometry {
  Geometry(Device::Impl& device, const Scene& scene);

  std::size_t vertices = 0, faces = 0, colors = 0;
  std::vector<MeshRange> meshes;

  Buffer<cl_float4> positions;                    ///< [vertex] object space
  Buffer<cl_uint> vertex_mesh;                    ///< [vertex]
  Buffer<cl_uint4> face_vertices;                 ///< [face] vertex indices; w = mesh
  Buffer<cl_uint4> face_colors;                   ///< [face] colour of each corner
  Buffer<cl_float4> color_values;                 ///< [color]
  Buffer<cl_float4> view_positions, view_colors;  ///< [view][vertex], [view][color]: of views' own shapes
  Incidence vertex_corners, color_corners;

  /// What the kernels read with the frame's strides.
  const Buffer<cl_float4>& positions_of(const shared::FrameParams& p) const {
    return p.position_stride != 0 ? view_positions : positions;
  }
  const Buffer<cl_float4>& colors_of(const shared::FrameParams& p) const {
    return p.color_stride != 0 ? view_colors : color_values;
  }

  std::size_t bytes() const;
};

/// A vector of three in the first components; w = 0.
cl_float4 to_cl(const glm::vec3& v);

/// Writes a part of a buffer of vectors. Blocks.
void write_range(Device::Impl& device, const Buffer<cl_float4>& buffer, std::size_t first,
                 std::span<const glm::vec3> values);

}  // namespace dpr
