// Base colours of fragments in scenes with textures: the corners' colours times the texture.
#pragma once

#include "kernels/surface.hpp"
#include "stages/bin.hpp"
#include "stages/geometry.hpp"
#include "stages/rasterize.hpp"

namespace dpr {

/// Planes of [fragment].
struct ColorPlanes {
  Buffer<float> red, green, blue;

  void resize(Device::Impl& device, Length length);
  void settle(std::size_t fragments);
  std::size_t bytes() const;
};

/// Everything of a frame that base colours are made of.
struct SurfaceInputs {
  const shared::FrameParams& p;
  const Geometry& geometry;
  const Buffer<shared::Triangle>& triangles;
  const Buffer<shared::ClippedFace>& clipped;  // where p.clips is set
  const Bin& bin;
  const Rasterize& rasterize;
};

class Surface {
 public:
  explicit Surface(Device::Impl& device) : device_(device), launch_(device) {}

  /// The base colours of the band's fragments.
  void forward(const SurfaceInputs& in, ColorPlanes& base);
  /// From the gradients of the base colours to those of the corners' colours and texture coordinates, and of
  /// barycentrics, to which they are added where the light has left its own there.
  void backward(const SurfaceInputs& in, const ColorPlanes& grad_base, bool adds, Buffer<float>& grad_bary1,
                Buffer<float>& grad_bary2, Buffer<float>& grad_corner_colors);
  /// Adds what goes by way of the levels of detail, as backward() found it, to the gradients of the corners
  /// on the screen, [pair][9] as Rasterize has them, and of clipped faces as Clip has them.
  void backward_detail(const SurfaceInputs& in, Buffer<float>& grad_corners, Buffer<float>& grad_clip);
  /// Lists the texels that the band's fragments see, by fragment and level, for the stage that gathers.
  void list(const SurfaceInputs& in, const ColorPlanes& grad_base);

  /// Bytes a fragment of the buffers below, of two levels, and of those that sorting needs.
  static constexpr std::size_t k_fragment_bytes =
      2 * (4 * sizeof(cl_uint) + sizeof(cl_float2) + sizeof(cl_float4));

  Buffer<float> grad_corner_texcoords;  ///< [pair][9] u, v and 0
  Buffer<cl_uint> place_count;          ///< [1] of those below
  Buffer<cl_uint> cells, numbers;  ///< [fragment][level] the first texel that is seen; the place's number
  Buffer<cl_float2> parts;         ///< [fragment][level] of its neighbours
  Buffer<cl_float4> grad_seen;     ///< [fragment][level] RGB of what is seen of the level; its tile

  std::size_t bytes() const;

 private:
  Device::Impl& device_;
  Buffer<float> grad_steps_;  // [pair][9] of the levels of detail: from backward() to backward_detail()
  Launcher<kernel::surface_forward, kernel::surface_backward, kernel::surface_detail_backward,
           kernel::surface_list>
      launch_;
};

}  // namespace dpr
