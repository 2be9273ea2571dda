// What the samples of a rigid image show, for shading outside of the library.
#pragma once

#include "kernels/samples.hpp"
#include "stages/bin.hpp"
#include "stages/rasterize.hpp"

namespace dpr {

class SampledSurface {
 public:
  explicit SampledSurface(Device::Impl& device) : device_(device), launch_(device) {}

  /// Of the rasterizer's band.
  void forward(const shared::FrameParams& p, const Bin& bin, const Rasterize& rasterize);
  /// To the gradients of the band's fragments.
  void backward(const shared::FrameParams& p, const Buffer<cl_float4>& grad_places, Rasterize& rasterize);

  Buffer<cl_float4>
      places;             ///< [view][height][width] barycentrics of corners 1 and 2, view depth; 0: nothing
  Buffer<cl_uint> faces;  ///< [view][height][width] of the scene, DPR_NO_FACE where nothing is

  std::size_t bytes() const { return places.capacity_bytes() + faces.capacity_bytes(); }

 private:
  Device::Impl& device_;
  Launcher<kernel::samples_forward, kernel::samples_backward> launch_;
};

}  // namespace dpr
