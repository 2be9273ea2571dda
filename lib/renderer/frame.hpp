// The last frame of a renderer as losses, solvers and measurements may see it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "dpr/renderer.hpp"
#include "stages/geometry.hpp"

namespace dpr {

/// Frames of all renderers are counted, so that a loss knows which one it was evaluated on.
std::uint64_t next_frame_number();

/// The images of a complete frame, valid until the renderer is changed or renders again.
struct FrameImages {
  std::uint64_t number;  ///< which one, among all renderers' frames
  std::size_t views;
  int width, height;
  const Buffer<cl_float4>& image;  ///< [view][height][width] RGBA
};

/// And of what they are.
struct Frame : FrameImages {
  const Buffer<cl_float4>& positions;  ///< [position] object space
  std::span<const MeshRange> meshes;   ///< whose positions these are
  bool has_own_shapes;                 ///< every view has positions of its own, not these
};

/// Waits until the frame is known to be complete. `caller` says in an error who wants it. Throws
/// InvalidArgument where there is none.
Frame last_frame(const Renderer& renderer, const char* caller);

/// Tangents of the images of a frame, [direction][view][height][width] RGBA; valid until the renderer's next
/// frame or tangents. Directions are not checked. Throws as last_frame().
const Buffer<cl_float4>& last_tangents(Renderer& renderer, std::span<const SceneTangent> directions,
                                       const char* caller);

/// Makes the renderer's frames show the normals that its scene's meshes give too, in an image of their own: in object
/// space, interpolated and composed as colours are, over 0. Until the next scene; nothing of it has gradients, and
/// frames are not cut into bands of samples.
void show_normals(Renderer& renderer);
/// [view][height][width] normals and alpha of the last frame. Throws as last_frame().
const Buffer<cl_float4>& last_normals(const Renderer& renderer, const char* caller);
/// Their tangents, of the last call of last_tangents().
const Buffer<cl_float4>& last_normal_tangents(const Renderer& renderer);

/// Makes the renderer's next frame, in the scene and the views that it has now, show depths along the view direction in
/// all three channels in place of colours: vertices need colours of their own. Tangents and gradients follow.
void show_depths(Renderer& renderer);

/// The fragments of a frame in one band, after its forward pass.
struct FrameFragments {
  std::size_t pairs, fragments;
  const Buffer<cl_uint>& pixel_starts;                 ///< [view * height * width + 1] runs of `list`
  const Buffer<cl_uint>& list;                         ///< [fragments] places in the buffers below, by pixel
  std::vector<float> depth, log_occupancy, occupancy;  ///< [fragments]
};

/// Throws InvalidArgument where the memory budget made several bands of the frame: then none has all of them.
FrameFragments last_fragments(const Renderer& renderer, const char* caller);

/// Throws InvalidArgument unless what `device` holds can be used together with what a renderer has on its
/// own; `what` names it.
void require_same_device(const Device& device, const Device& of_renderer, const char* what);

}  // namespace dpr
