// Opacity of surfaces: what it makes of the fragments' occupancies. Launched after occupancy where some surface is
// not opaque.
#pragma once

#include "dpr/smoothing.hpp"
#include "kernels/opacity.hpp"
#include "kernels/opacity_texels.hpp"
#include "stages/surface.hpp"
#include "stages/tangents.hpp"

namespace dpr {

/// What kernels of surfaces take, and the opacities of texels.
template <class Arguments>
struct OpacityArguments : Arguments {
  shared::OpacityParams in_force;
  const Buffer<cl_float4>& opacities;
};

class Opacity {
 public:
  explicit Opacity(Device::Impl& device) : device_(device) {}

  void forward(const SurfaceArguments& in, const Geometry& geometry, const Bin& bin,
               const Rasterize& rasterize);
  /// Between the backward passes of shading, with its lists of texels, and of occupancy, which may be sampled.
  void backward(const SurfaceArguments& in, const Geometry& geometry, const Bin& bin,
                const Rasterize& rasterize);
  /// Lists the texels whose opacities the band's fragments see. After backward().
  void list_texels(const SurfaceArguments& in, Surface& surface, const Bin& bin, const Rasterize& rasterize);
  /// From the tangents of barycentrics and opacities to those of ln p, between those of occupancy and of shading.
  void tangent(const SurfaceTangentArguments& in, const Geometry& geometry, const Bin& bin,
               const Rasterize& rasterize, const Buffer<cl_float4>& opacity_tangents, Surface* surface);

  /// The least and the largest opacity in force. Less, and the joint composition drops a fragment with its
  /// gradient; the largest is below 1 where derivatives by opacities need what opaque surfaces hide.
  void set_params(const Smoothing& smoothing, bool follows_opacities, bool is_textured);
  bool is_bounded() const { return in_force_.largest < 1; }

  Buffer<float> grad_pairs;  ///< [pair][9] of the corners' opacities in the first of three each

  std::size_t bytes() const { return grad_pairs.capacity_bytes(); }

 private:
  using Kernels = Launcher<kernel::opacity_forward, kernel::opacity_backward, kernel::opacity_tangent>;
  using TextureKernels = Launcher<kernel::opacity_texels_forward, kernel::opacity_texels_backward,
                                  kernel::opacity_texels_list, kernel::opacity_texels_tangent>;
  /// Made for the first frame that needs them.
  Kernels& kernels() { return launch_ ? *launch_ : launch_.emplace(device_); }
  TextureKernels& texture_kernels() {
    return launch_textures_ ? *launch_textures_ : launch_textures_.emplace(device_);
  }

  Device::Impl& device_;
  shared::OpacityParams in_force_{1, 1, 0, 0};
  std::optional<Kernels> launch_;
  std::optional<TextureKernels> launch_textures_;
};

}  // namespace dpr
