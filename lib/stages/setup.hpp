// Triangles of every view: assembled, culled, bounded, and the tiles of each counted.
#pragma once

#include "kernels/setup.hpp"
#include "stages/geometry.hpp"
#include "stages/transform.hpp"

namespace dpr {

class Setup {
 public:
  explicit Setup(Device::Impl& device) : device_(device), launch_(device) {}

  /// `hidden` is [view][mesh], the orientation of faces that nothing can see; 0: all may be. `counts` gets
  /// how many tiles are listed for each triangle, [view][face], with room for their sum.
  void forward(const shared::FrameParams& p, const DeviceViews& views, const Geometry& geometry,
               const Buffer<cl_float4>& ndc, const Buffer<float>& hidden, Buffer<cl_uint>& counts);

  Buffer<cl_uchar> facing;             ///< [view][face] DPR_FACE_FRONT, ...
  Buffer<cl_uchar> kept;               ///< [view][face] 0 where a triangle is dropped, 1 where not
  Buffer<shared::Triangle> triangles;  ///< [view][face] of those that have tiles

  std::size_t bytes() const {
    return facing.capacity_bytes() + kept.capacity_bytes() + triangles.capacity_bytes();
  }

 private:
  Device::Impl& device_;
  Launcher<kernel::setup_forward> launch_;
};

}  // namespace dpr
