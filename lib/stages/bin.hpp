// (tile, triangle) pairs: in face order, which gathers gradients, and by tile, which lists a pixel's
// fragments.
#pragma once

#include "device/kernel.hpp"
#include "stages/scan.hpp"
#include "stages/sort.hpp"

namespace dpr {

class Bin {
 public:
  explicit Bin(Device::Impl& device);

  /// Blocks to read the number of pairs.
  void forward(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles);

  std::size_t pairs = 0;
  Buffer<cl_uint> pair_starts;  ///< [view * face + 1] pairs of a face of a view
  Buffer<cl_uint> pair_face;    ///< [pair] view * faces + face
  Buffer<cl_uint> pair_tile;    ///< [pair] view * tiles + tile
  Buffer<cl_uint> order;        ///< [pair] pairs by tile, then by face
  Buffer<cl_uint> tile_starts;  ///< [view * tile + 1] runs of `order`

  std::size_t bytes() const;

 private:
  Device::Impl& device_;
  Kernel<shared::FrameParams, In<shared::Triangle>, Out<cl_uint>> count_;
  Kernel<shared::FrameParams, In<shared::Triangle>, In<cl_uint>, Out<cl_uint>, Out<cl_uint>, Out<cl_uint>>
      fill_;
  Scan scan_;
  Sort sort_;
  Buffer<cl_uint> counts_, sorted_tiles_;
};

}  // namespace dpr
