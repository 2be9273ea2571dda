// What the samples of a rigid image show, for shading outside of the library.
#pragma once

#include "kernels/samples.hpp"
#include "stages/bin.hpp"
#include "stages/rasterize.hpp"
#include "stages/tangents.hpp"

namespace dpr {

class SampledSurface {
 public:
  explicit SampledSurface(Device::Impl& device) : device_(device), launch_(device) {}

  /// Of the rasterizer's band, the nearest `layers` surfaces of each sample.
  void forward(const shared::FrameParams& p, const Bin& bin, const Rasterize& rasterize, cl_uint layers);
  /// Of all bands, after forward(), to `steps`.
  void find_steps(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles,
                  const Buffer<shared::ClippedFace>& clipped);
  /// To the gradients of the band's fragments.
  void backward(const shared::FrameParams& p, const Buffer<cl_float4>& grad_places, cl_uint layers,
                Rasterize& rasterize);
  /// Tangents of what forward() finds, along a group's directions, to `moved`.
  void tangent(const shared::FrameParams& p, const Rasterize& rasterize, cl_uint layers,
               const Tangents& tangents);

  Buffer<cl_float4>
      places;  ///< [layer][view][height][width] barycentrics of corners 1 and 2, view depth; 0: nothing
  Buffer<cl_uint> faces;    ///< [layer][view][height][width] of the scene, DPR_NO_FACE where nothing is
  Buffer<cl_float4> steps;  ///< the same, of corners 1 and 2 to the right and down

  Buffer<cl_float4> moved;  ///< [direction] of places

  std::size_t bytes() const {
    return places.capacity_bytes() + faces.capacity_bytes() + steps.capacity_bytes() + moved.capacity_bytes();
  }

 private:
  Device::Impl& device_;
  Launcher<kernel::samples_forward, kernel::samples_steps, kernel::samples_backward, kernel::samples_tangent>
      launch_;
};

}  // namespace dpr
