// Attributes that surfaces show in place of their colours: their geometry, or rows of numbers.
#pragma once

#include "dpr/attribute_images.hpp"
#include "kernels/attribute.hpp"
#include "stages/exchange.hpp"
#include "stages/geometry.hpp"
#include "stages/tangents.hpp"
#include "stages/transform.hpp"

namespace dpr {

/// Colours that follow from the geometry of a frame: depths or positions of vertices, normals of faces.
class GeometryColors {
 public:
  /// `attribute` is depth, position or normal.
  GeometryColors(Device::Impl& device, Attribute attribute);

  /// Fills [view][color], after the frame's transform.
  void forward(const shared::FrameParams& p, const Geometry& geometry, const Transform& transform,
               Buffer<cl_float4>& colors);
  /// Before the transform's backward pass: adds to z of `grad_depth`, and writes `grad_world`, both
  /// [view][vertex].
  void backward(const shared::FrameParams& p, const Geometry& geometry, const Transform& transform,
                const Buffer<cl_float4>& grad_colors, Buffer<cl_float4>& grad_depth,
                Buffer<cl_float4>& grad_world);
  /// Fills the directions' colours, after the transform's tangents; of positions and normals with those of the world.
  void tangent(const shared::FrameParams& p, const Geometry& geometry, const Transform& transform,
               Tangents& tangents);
  bool needs_world() const { return attribute_ != Attribute::depth; }

  std::size_t shown_views = 0;  ///< those behind these show 1

 private:
  bool is_of_faces() const { return attribute_ == Attribute::normal; }
  cl_uint shows_depth() const { return attribute_ == Attribute::depth ? 1 : 0; }

  Attribute attribute_;
  Device::Impl& device_;
  Launcher<kernel::attribute_vertices_forward, kernel::attribute_vertices_backward,
           kernel::attribute_vertices_tangent, kernel::attribute_normals_forward,
           kernel::attribute_normals_backward, kernel::attribute_normals_tangent>
      launch_;
};

/// Row that each vertex, face or corner shows, and those that show each row, in order.
struct RowMap {
  RowMap() = default;
  RowMap(Device::Impl& device, std::span<const cl_uint> row_of_shown, std::size_t rows);

  std::size_t rows = 0, shown = 0;
  Buffer<cl_uint> row_of;            ///< [shown]
  Buffer<cl_uint> starts, shown_by;  ///< [row + 1], [shown]

  std::size_t bytes() const {
    return row_of.capacity_bytes() + starts.capacity_bytes() + shown_by.capacity_bytes();
  }
};

/// Rows of the caller's or the scene's, and positions, at what is shown.
class ShownRows {
 public:
  explicit ShownRows(Device::Impl& device) : device_(device), launch_(device) {}

  /// From values[row][channel] to colors[pass][view][shown], three channels a pass; passes behind them
  /// show 1.
  void forward(const RowMap& map, std::size_t channels, const Buffer<float>& values, std::size_t passes,
               std::size_t views, Buffer<cl_float4>& colors);
  /// grad[row][channel].
  void backward(const RowMap& map, std::size_t channels, std::size_t views,
                const Buffer<cl_float4>& grad_colors, Buffer<float>& grad);

  /// From positions[source][row] to moved[copy][shown], the sources in turn.
  void move(const RowMap& map, std::size_t sources, const Buffer<cl_float4>& positions, std::size_t copies,
            Buffer<cl_float4>& moved);
  /// grad[source][row].
  void move_backward(const RowMap& map, std::size_t sources, const Buffer<cl_float4>& grad_moved,
                     std::size_t copies, Buffer<cl_float4>& grad);

 private:
  Device::Impl& device_;
  Launcher<kernel::attribute_rows_forward, kernel::attribute_rows_backward,
           kernel::attribute_positions_forward, kernel::attribute_positions_backward>
      launch_;
};

/// The texture coordinates of a scene's meshes, one after the other, whether they have textures or not.
class CornerTexcoords {
 public:
  static constexpr std::size_t k_channels = 2;

  /// Without any where a mesh has none.
  CornerTexcoords(Device::Impl& device, const Scene& scene);

  bool empty() const { return map.rows == 0; }
  /// Takes the coordinates in force, which for textured meshes the device has.
  void update(const Geometry& geometry, Exchange& exchange);
  std::size_t bytes() const { return map.bytes() + values.capacity_bytes(); }

  RowMap map;                      ///< shown by corners, face after face
  Buffer<float> values;            ///< [texcoord][2]
  std::vector<std::size_t> first;  ///< [mesh + 1] of `values`
};

}  // namespace dpr
