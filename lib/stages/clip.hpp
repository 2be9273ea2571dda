// Faces that cross the near plane or the far one: found, and rasterized in place of the whole triangles that
// other stages know.
#pragma once

#include <optional>

#include "kernels/clip.hpp"
#include "kernels/clip_tangent.hpp"
#include "stages/bin.hpp"
#include "stages/geometry.hpp"
#include "stages/setup.hpp"
#include "stages/transform.hpp"

namespace dpr {

class Rasterize;

class Clip {
 public:
  explicit Clip(Device::Impl& device) : device_(device) {}

  /// Finds the faces, and sets up what is left of them, after Setup::forward(), which drops them.
  void forward(const shared::FrameParams& p, const DeviceViews& views, const Geometry& geometry,
               const Transform& transform, Setup& setup, Buffer<cl_uint>& counts);
  /// Adds what is missing of their coverage, [pair] as rasterize_cover leaves it.
  void cover(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, const Bin& bin,
             Buffer<cl_uint2>& masks, Buffer<cl_uint>& counts);
  /// Replaces the distances, depths and barycentrics of their fragments: those are of the whole face, so that
  /// shading needs to know nothing.
  void fragments(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, const Bin& bin,
                 Rasterize& rasterize);
  /// Replaces the gradients of their corners, and adds those that go by way of the plane, with what these
  /// give to projections and lenses.
  void backward(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, const Bin& bin,
                Rasterize& rasterize);
  /// The tangents of what is left of them, by those of the vertices.
  void tangent_of_outlines(const shared::FrameParams& p, const Geometry& geometry, Tangents& tangents);
  /// Replaces the tangents of their fragments. After tangent_of_outlines().
  void tangent(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, const Bin& bin,
               const Rasterize& rasterize, Tangents& tangents);

  Buffer<shared::ClippedFace> faces;  ///< [view][face] which of them are clipped, and to what
  Buffer<float> grad_corners;         ///< [pair][9] of the corners' x times depth, y times depth, depth
  Buffer<cl_float4> grad;             ///< [view][vertex] the same, gathered
  Buffer<float> grad_cuts;            ///< [DPR_CUT_CHANNELS][pair] where a lens distorts

  std::size_t bytes() const {
    return faces.capacity_bytes() + grad_corners.capacity_bytes() + grad.capacity_bytes() +
           grad_cuts.capacity_bytes();
  }

 private:
  Device::Impl& device_;
  std::optional<
      Launcher<kernel::clip_forward, kernel::clip_cover, kernel::clip_fragments, kernel::clip_backward,
               kernel::clip_backward_lens>>
      launch_;  // made for the first frame that may have such faces
  std::optional<Launcher<kernel::clip_outline_tangent, kernel::clip_tangent>> tangent_;
  const DeviceViews* views_ = nullptr;  // of the frame
};

}  // namespace dpr
