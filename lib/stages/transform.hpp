// Vertices to world and NDC, gradients back to object space and to the poses, and tangents.
#pragma once

#include "kernels/transform.hpp"
#include "stages/geometry.hpp"
#include "stages/reduce.hpp"
#include "stages/tangents.hpp"

namespace dpr {

/// The views of a frame on the device.
struct DeviceViews {
  Buffer<shared::ViewParams> cameras;  ///< [view]
  Buffer<cl_float4> models;            ///< [view][mesh][3] rows of object to world
  Buffer<cl_uint> vertex_starts;       ///< [view * mesh + 1] runs of [view][vertex]
};

class Transform {
 public:
  /// Projections are rounded correctly where the device can: a vertex that is seen at a sample's centre lies there.
  explicit Transform(Device::Impl& device) : device_(device), launch_(device, division_option(device)) {}

  /// Makes room for the normals that shading finds, if it is to.
  void forward(const shared::FrameParams& p, const DeviceViews& views, const Geometry& geometry,
               bool has_normals);
  /// From the gradients of `ndc` to those of `world`, in place. `grad_clip` is what clipped faces add where
  /// p.clips is set, [view][vertex] of x times depth, y times depth and depth; `grad_lit` what shading adds
  /// to that of `world`, if the scene is lit. Fills `partial_sums`.
  void backward(const shared::FrameParams& p, const DeviceViews& views, bool lit,
                const Buffer<cl_float4>& grad_clip, const Buffer<cl_float4>& grad_lit,
                Buffer<cl_float4>& grad);
  void backward_positions(const shared::FrameParams& p, const DeviceViews& views, const Geometry& geometry,
                          const Buffer<cl_float4>& grad_world);
  /// From directions of poses, cameras and positions to tangents of `ndc`, of `world` if the scene is lit, and
  /// of homogeneous coordinates where faces may be clipped.
  void tangent(const shared::FrameParams& p, const DeviceViews& views, const Geometry& geometry,
               Tangents& tangents);

  Buffer<cl_float4> world;  ///< [view][vertex], then [view][normal]
  Buffer<cl_float4> ndc;    ///< [view][vertex] x, y, view depth
  /// [DPR_POSE_CHANNELS or, distorted, DPR_LENS_CHANNELS][view][mesh][2][slot]: see Summation.
  Buffer<float> partial_sums;
  std::size_t slots = 0;
  Buffer<cl_float4> grad_positions;  ///< [position], of views' own shapes [view][position]; object space

  std::size_t bytes() const {
    return world.capacity_bytes() + ndc.capacity_bytes() + partial_sums.capacity_bytes() +
           grad_positions.capacity_bytes();
  }

 private:
  Device::Impl& device_;
  Launcher<kernel::transform_forward, kernel::transform_backward, kernel::transform_backward_lens,
           kernel::transform_backward_positions, kernel::transform_tangent>
      launch_;
};

}  // namespace dpr
