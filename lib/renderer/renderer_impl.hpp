// What a Renderer holds: the scene, its geometry on the device, and the stages with their buffers.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "dpr/mesh_loss.hpp"
#include "dpr/renderer.hpp"
#include "stages/aggregate.hpp"
#include "stages/aov.hpp"
#include "stages/bin.hpp"
#include "stages/gather.hpp"
#include "stages/geometry.hpp"
#include "stages/occupancy.hpp"
#include "stages/rasterize.hpp"
#include "stages/reduce.hpp"
#include "stages/setup.hpp"
#include "stages/shade.hpp"
#include "stages/transform.hpp"

namespace dpr {

struct Renderer::Impl {
  explicit Impl(Device device);

  void set_views(std::span<const View> views, std::size_t first_view);
  /// Checked already.
  void set_shapes(std::span<const glm::vec3> positions, std::span<const glm::vec3> colors);
  void set_smoothing(const Smoothing& smoothing);
  /// Enqueues the whole frame where it can be expected to fit into the buffers that the last one left; else
  /// blocks to read the sizes to allocate.
  void forward();
  /// `mesh_loss`, where there is one, adds its gradient to that of the positions.
  SceneGradient backward(const Buffer<cl_float4>& grad_images, MeshLoss::Impl* mesh_loss = nullptr);
  /// Fills `aov` for the last frame, if it does not hold that already.
  void render_aov();

  /// Throws InvalidArgument unless there is an image to work with; `caller` says who wants it. An image is
  /// known to be complete after that: where the last frame's buffers were too small, the frame is rendered
  /// again, and what forward() throws is thrown here.
  void require_scene(const char* caller) const;
  void require_forward(const char* caller);
  /// Held in buffers.
  std::size_t bytes() const;

  Device device;
  Scene scene;
  std::vector<View> views;
  bool rendered = false;            // the stages hold the frame of the current scene, or it is on the way
  std::optional<FrameCounts> room;  // that it was given, until it is known to fit
  std::optional<FrameCounts> last_counts;  // of a frame like the next one; none: nothing is to be expected
  std::uint64_t frame_number = 0;          // which frame that is, among all renderers'

  std::optional<Geometry> geometry;
  DeviceViews device_views;
  Buffer<cl_uint> view_vertex_starts;  // [view * mesh + 1] of [view][vertex]: segments of the pose gradients
  Buffer<cl_uint> all_pixels;          // [2]: one segment
  shared::FrameParams frame{};
  std::vector<Band> bands;  // of the last forward()

  Transform transform;
  Setup setup;
  Bin bin;
  Rasterize rasterize;
  Shade shade;
  Occupancy occupancy;
  Aggregate aggregate;
  Gather gather;
  Reduce reduce;
  std::optional<AovStage> aov;  // made when first asked for
  std::uint64_t aov_frame = 0;  // the frame it holds

  Buffer<cl_float4> host_grad_images;                   // where gradients that come from the host go
  Buffer<cl_float4> grad_ndc, grad_world, grad_colors;  // [view][vertex] twice, [color]

 private:
  ShadeInputs shade_inputs() const { return {frame, device_views, *geometry, transform, bin, rasterize}; }
  AggregateInputs aggregate_inputs() { return {frame, device_views, bin, rasterize, occupancy, shade}; }

  std::optional<FrameCounts> expected_room() const;
  void forward_within(const FrameCounts& expected);
  void forward_measured();
  void settle();

  /// The stages from the fragments on: of a band, and backward of the one rendered last.
  void render(const Band& band);
  void shade_and_aggregate();
  void differentiate(const Buffer<cl_float4>& grad_images);

  void read_mesh_gradients(SceneGradient& gradient, MeshLoss::Impl* mesh_loss);
  void read_summed_gradients(SceneGradient& gradient);
};

}  // namespace dpr
