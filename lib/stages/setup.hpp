// Triangles of every view: assembled, culled, bounded.
#pragma once

#include "device/kernel.hpp"
#include "stages/geometry.hpp"
#include "stages/transform.hpp"

namespace dpr {

class Setup {
 public:
  explicit Setup(Device::Impl& device);

  void forward(const shared::FrameParams& p, const DeviceViews& views, const Geometry& geometry,
               const Buffer<cl_float4>& ndc);

  Buffer<shared::Triangle> triangles;  ///< [view][face]

  std::size_t bytes() const { return triangles.capacity_bytes(); }

 private:
  Device::Impl& device_;
  Kernel<shared::FrameParams, In<shared::ViewParams>, In<cl_uint4>, In<cl_float4>, Out<shared::Triangle>>
      forward_;
};

}  // namespace dpr
