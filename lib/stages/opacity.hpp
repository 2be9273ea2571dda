// Opacity of surfaces: what it makes of the fragments' occupancies. Launched after occupancy where some surface is
// not opaque.
#pragma once

#include "dpr/smoothing.hpp"
#include "kernels/opacity.hpp"
#include "stages/bin.hpp"
#include "stages/geometry.hpp"
#include "stages/rasterize.hpp"
#include "stages/tangents.hpp"

namespace dpr {

class Opacity {
 public:
  explicit Opacity(Device::Impl& device) : device_(device) {}

  void forward(const shared::FrameParams& p, const Geometry& geometry, const Bin& bin, Rasterize& rasterize);
  /// Between the backward passes of shading and of occupancy, which may be sampled.
  void backward(const shared::FrameParams& p, const Geometry& geometry, const Bin& bin, Rasterize& rasterize,
                bool is_sampled);
  /// From the tangents of barycentrics and opacities to those of ln p, after Occupancy::tangent().
  void tangent(const shared::FrameParams& p, const Geometry& geometry, const Bin& bin,
               const Rasterize& rasterize, Tangents& tangents);

  /// The least and the largest opacity in force. Less, and the joint composition drops a fragment with its
  /// gradient; the largest is below 1 where derivatives by opacities need what opaque surfaces hide.
  void set_bounds(Composition composition, bool follows_opacities);
  bool is_bounded() const { return bounds_.s[1] < 1; }

  Buffer<float> grad_pairs;  ///< [pair][9] of the corners' opacities in the first of three each

  std::size_t bytes() const { return grad_pairs.capacity_bytes(); }

 private:
  using Kernels = Launcher<kernel::opacity_forward, kernel::opacity_backward, kernel::opacity_tangent>;
  /// Made for the first frame that needs them.
  Kernels& kernels();

  Device::Impl& device_;
  cl_float2 bounds_{{1, 1}};
  std::optional<Kernels> launch_;
};

}  // namespace dpr
