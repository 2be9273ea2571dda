// Triangles of every view: assembled, culled, bounded, and the tiles of each counted.
#pragma once

#include "kernels/setup.hpp"
#include "stages/geometry.hpp"
#include "stages/reduce.hpp"
#include "stages/transform.hpp"

namespace dpr {

class Setup {
 public:
  explicit Setup(Device::Impl& device) : device_(device), launch_(device), reduce_(device) {}

  /// `hidden` is [view][mesh], the orientation of faces that nothing can see; 0: all may be. `counts` gets
  /// how many tiles are listed for each triangle, [view][face], with room for their sum.
  void forward(const shared::FrameParams& p, const DeviceViews& views, const Geometry& geometry,
               const Buffer<cl_float4>& ndc, const Buffer<float>& hidden, Buffer<cl_uint>& counts);

  /// Measures the volume of a mesh that is no instance.
  void measure(const Geometry& geometry, const Scene& scene, std::size_t mesh);
  /// `hidden` for forward() where all meshes that were measured have faces that wind counter-clockwise; by their volumes
  /// as measured it is the result.
  const Buffer<float>& hide(const shared::FrameParams& p, const Buffer<float>& hidden);
  /// Forgets all volumes: the scene is another.
  void forget_volumes() noexcept { has_volumes_ = false; }

  Buffer<cl_uchar> facing;             ///< [view][face] DPR_FACE_FRONT, ...
  Buffer<cl_uchar> kept;               ///< [view][face] 0 where a triangle is dropped, 1 where not
  Buffer<shared::Triangle> triangles;  ///< [view][face] of those that have tiles

  std::size_t bytes() const {
    return facing.capacity_bytes() + kept.capacity_bytes() + triangles.capacity_bytes() + reduce_.bytes() +
           runs_.capacity_bytes() + volumes_.capacity_bytes() + hidden_.capacity_bytes() +
           sources_.capacity_bytes() + run_starts_.capacity_bytes();
  }

 private:
  Device::Impl& device_;
  Launcher<kernel::setup_forward, kernel::setup_volumes, kernel::setup_hidden> launch_;
  Reduce reduce_;
  Buffer<float> runs_, volumes_, hidden_;  // [2][run]; [mesh][2], 1 where not measured; [view][mesh]
  Buffer<cl_uint> sources_, run_starts_;
  bool has_volumes_ = false;
};

}  // namespace dpr
