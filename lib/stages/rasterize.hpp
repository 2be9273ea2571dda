// Fragments: every (pixel, triangle) pair within the blur distance, by triangle, and each pixel's list of its
// own.
#pragma once

#include "device/kernel.hpp"
#include "stages/bin.hpp"
#include "stages/scan.hpp"

namespace dpr {

class Rasterize {
 public:
  explicit Rasterize(Device::Impl& device);

  /// Blocks to read the number of fragments.
  void forward(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, const Bin& bin);
  /// From the gradients of distance, depth and barycentrics to `grad_corners`.
  void backward(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, const Bin& bin,
                const Buffer<float>& grad_distance, const Buffer<float>& grad_depth,
                const Buffer<float>& grad_bary1, const Buffer<float>& grad_bary2);

  std::size_t fragments = 0;                    ///< with the padding of the pairs' runs
  std::size_t listed_fragments = 0;             ///< without
  Buffer<cl_uint2> masks;                       ///< [pair] pixels of its tile that a pair covers
  Buffer<cl_uint> fragment_starts;              ///< [pair + 1]
  Buffer<cl_uint> pixel_starts;                 ///< [view * height * width + 1] runs of `list`
  Buffer<cl_uint> list;                         ///< fragments by pixel
  Buffer<cl_uint> fragment_pair;                ///< [fragment]
  Buffer<cl_uint> fragment_pixel;               ///< [fragment] x | y << 16
  Buffer<float> distance, depth, bary1, bary2;  ///< [fragment]
  Buffer<float> grad_corners;                   ///< [pair][9] x, y (NDC) and view depth of the corners

  std::size_t bytes() const;

 private:
  Device::Impl& device_;
  Kernel<shared::FrameParams, cl_uint, In<shared::Triangle>, In<cl_uint>, In<cl_uint>, Out<cl_uint2>,
         Out<cl_uint>>
      cover_;
  Kernel<shared::FrameParams, In<cl_uint>, In<cl_uint2>, Out<cl_uint>> count_;
  Kernel<shared::FrameParams, In<cl_uint>, In<cl_uint2>, In<cl_uint>, In<cl_uint>, Out<cl_uint>> list_;
  Kernel<shared::FrameParams, cl_uint, In<shared::Triangle>, In<cl_uint>, In<cl_uint>, In<cl_uint2>,
         In<cl_uint>, Out<cl_uint>, Out<cl_uint>, Out<float>, Out<float>, Out<float>, Out<float>>
      forward_;
  Kernel<shared::FrameParams, cl_uint, In<shared::Triangle>, In<cl_uint>, In<cl_uint2>, In<cl_uint>,
         In<cl_uint>, In<float>, In<float>, In<float>, In<float>, Out<float>>
      backward_;
  Scan scan_;
  Buffer<cl_uint> counts_;
};

}  // namespace dpr
