// Base colours of fragments in scenes with textures: the corners' colours times the texture.
#pragma once

#include "kernels/surface.hpp"
#include "stages/bin.hpp"
#include "stages/geometry.hpp"
#include "stages/rasterize.hpp"

namespace dpr {

/// What the kernels of surfaces and of light take, by the names of their arguments.
struct SurfaceArguments {
  const shared::FrameParams& p;
  const shared::LightingParams& lp;
  const Buffer<cl_uint>&pairs, &pair_face, &fragment_starts;
  const Buffer<shared::ViewParams>& views;
  const Buffer<shared::Light>& lights;
  const Buffer<cl_uint4>& faces;
  const Buffer<cl_float4>&colors, &world, &materials, &texcoords, &texels;
  const Buffer<shared::Texture>& textures;
  const Buffer<shared::Triangle>& triangles;
  const Buffer<shared::ClippedFace>& clipped;  // where p.clips is set
  Buffer<float>&fragments, &grads, &grad_pairs, &channels;
};

/// The same for their kernels of tangents.
struct SurfaceTangentArguments : SurfaceArguments {
  shared::TangentParams q;
  const Buffer<cl_float4>&color_tangents, &world_tangents, &vertices, &clip_vertices;
  Buffer<float>& tangents;
};

/// The same for those that list the texels which fragments see.
struct SurfaceListArguments : SurfaceArguments {
  Buffer<cl_uint>& cells;
  Buffer<shared::SeenTexels>& seen;
};

class Surface {
 public:
  explicit Surface(Device::Impl& device) : device_(device), launch_(device) {}

  /// The base colours of the band's pairs of fragments.
  void forward(const SurfaceArguments& in, const Range& pairs) {
    launch_(pairs, kernel::surface_forward::pick(in));
  }
  /// From the gradients of the base colours to those of the corners' colours and texture coordinates, and of
  /// barycentrics, to which they are added where the light has left its own there.
  void backward(const SurfaceArguments& in, const Range& pairs) {
    launch_(pairs, kernel::surface_backward::pick(in));
  }
  /// Adds what goes by way of the levels of detail, as backward() found it, to the gradients of the corners
  /// on the screen, [pair][9] as Rasterize has them, and of clipped faces as Clip has them.
  void backward_detail(const SurfaceArguments& in, const Range& pairs, Buffer<float>& grad_corners,
                       Buffer<float>& grad_clip);
  /// Lists the texels that the band's fragments see, by fragment and level, for the stage that gathers.
  void list(const SurfaceArguments& in, const Range& pairs, const Bin& bin, const Rasterize& rasterize);
  /// Around another stage's kernel that lists: makes room, and says where the texels lie.
  void start_list(const shared::FrameParams& p, const Rasterize& rasterize);
  void finish_list(const SurfaceArguments& in, const Bin& bin, const Rasterize& rasterize);

  /// From the tangents of barycentrics, corners and their colours to those of the base colours.
  void tangent(const SurfaceTangentArguments& in, const Range& pairs) {
    launch_(pairs, kernel::surface_tangent::pick(in));
    tangent_detail(in, pairs);
  }
  /// Adds what goes by way of the levels of detail to three planes from in.q.base_plane on. The derivatives by them lie
  /// behind the last direction's tangents.
  void tangent_detail(const SurfaceTangentArguments& in, const Range& pairs) {
    if (in.p.levels > 1) launch_(pairs, kernel::surface_detail_tangent::pick(in));
  }

  /// Bytes a fragment of the buffers below, of two levels, and of those that sorting needs.
  static constexpr std::size_t k_fragment_bytes = 2 * (4 * sizeof(cl_uint) + sizeof(shared::SeenTexels));

  Buffer<cl_uint> place_count;      ///< [1] of those below
  Buffer<cl_uint> cells, numbers;   ///< [fragment][level] the first texel that is seen; what sorting permutes
  Buffer<shared::SeenTexels> seen;  ///< [fragment][level]

  std::size_t bytes() const {
    return place_count.capacity_bytes() + cells.capacity_bytes() + numbers.capacity_bytes() +
           seen.capacity_bytes();
  }

 private:
  Device::Impl& device_;
  Launcher<kernel::surface_forward, kernel::surface_backward, kernel::surface_detail_backward,
           kernel::surface_list, kernel::surface_place, kernel::surface_tangent,
           kernel::surface_detail_tangent>
      launch_;
};

}  // namespace dpr
