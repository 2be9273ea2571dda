// The last frame of a renderer as losses, solvers and measurements may see it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "dpr/renderer.hpp"
#include "stages/geometry.hpp"

namespace dpr {

/// A complete frame, valid until the renderer is changed or renders again.
struct Frame {
  std::uint64_t number;  ///< which one, among all renderers' frames
  std::size_t views;
  int width, height;
  const Buffer<cl_float4>& image;      ///< [view][height][width] RGBA
  const Buffer<cl_float4>& positions;  ///< [vertex] object space
  std::span<const MeshRange> meshes;   ///< whose vertices these are
  bool has_own_shapes;                 ///< every view has positions of its own, not these
};

/// Waits until the frame is known to be complete. `caller` says in an error who wants it. Throws
/// InvalidArgument where there is none.
Frame last_frame(const Renderer& renderer, const char* caller);

/// The fragments of a frame in one band, after its forward pass.
struct FrameFragments {
  std::size_t pairs, fragments;
  const Buffer<cl_uint>& pixel_starts;  ///< [view * height * width + 1] runs of `list`
  const Buffer<cl_uint>& list;          ///< [fragments] places in the buffers below, by pixel
  const Buffer<float>&depth, &log_occupancy, &occupancy;
};

/// Throws InvalidArgument where the memory budget made several bands of the frame: then none has all of them.
FrameFragments last_fragments(const Renderer& renderer, const char* caller);

/// Throws InvalidArgument unless what `device` holds can be used together with the renderer; `what` names it.
void require_same_device(const Device& device, const Renderer& renderer, const char* what);

}  // namespace dpr
