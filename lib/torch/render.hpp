// The renderer as a libtorch operator, torch.ops.dpr.render, render_lit and render_textured, with gradients.
#pragma once

#include <string>
#include <vector>

#include "torch/batch_renderer.hpp"

namespace dpr::torch_op {

/// Renders a batch in one set of launches. All tensors are float32 on the CPU and are copied to the
/// device; those that are not contiguous are copied once more before.
/// @param vertices    [view or 1, vertex, 3] world space
/// @param colors      [view or 1, vertex, 3] linear RGB; or [view or 1, face, 3], if there are not as many
/// faces as
///                    vertices
/// @param views       [view, 4, 4] world to camera, OpenGL axes, acting on column vectors; affine
/// @param intrinsics  [view, 4] fx, fy, cx, cy in pixels; the origin is the corner of the top-left pixel.
/// [view, 9]
///                    with OpenCV's k1, k2, p1, p2, k3 of the lens. [view, 1]: orthographic, world units from
///                    the lower to the upper edge
/// @param background  [3] linear RGB
/// @return [view, height, width, 4] RGBA over the background; alpha is the silhouette
/// Differentiable once with respect to all five, the matrices of the views as any affine matrices. A graph
/// keeps the frame's buffers on the device until it is freed. Throws RenderError; c10::Error where second
/// derivatives are asked for.
at::Tensor render(const c10::intrusive_ptr<BatchRenderer>& renderer, const at::Tensor& vertices,
                  const at::Tensor& colors, const at::Tensor& views, const at::Tensor& intrinsics,
                  const at::Tensor& background);

using NamedTensors = c10::Dict<std::string, at::Tensor>;
/// By the keys of a scene's "lights".
using LightTensors = NamedTensors;

/// The same in the light of a scene file: ambient [3], harmonics [9, 3], and for every kind of light [light,
/// number], the members one after the other as the README has them; what is left out is as in a scene file.
/// With a leading dimension of views a tensor is of each view by itself; then these are rendered one after
/// the other, and a graph keeps a frame of each. Differentiable with respect to them too, and to the matrices
/// of the views as rigid motions: with lights, which stay in the world, an image does not depend on the
/// vertices in camera space alone.
at::Tensor render_lit(const c10::intrusive_ptr<BatchRenderer>& renderer, const at::Tensor& vertices,
                      const at::Tensor& colors, const at::Tensor& views, const at::Tensor& intrinsics,
                      const at::Tensor& background, const LightTensors& lights);

struct TextureTensors {
  std::vector<at::Tensor>
      textures;  ///< [height, width, 3] linear RGB, row 0 on top; or [view, height, width, 3]
  /// texcoords: [vertex, 2], [face, 3, 2] of corners, or [texcoord, 2] and int64 face_texcoords [face, 3];
  /// face_textures: int64 [face], -1 for none, the first unless given; of materials specular [material, 3],
  /// shininess [material] (that of the lights unless given), and int64 face_materials [face], the first
  /// unless given. All but textures are the same for all views.
  NamedTensors surface;
  std::vector<std::string> wraps, filters;  ///< one of each texture, or of all; none: "repeat", "bilinear"
};

/// The same with textures and materials, and lights unless their dictionary is empty. Differentiable with
/// respect to texels, texture coordinates and materials too. Textures of each view by itself are rendered as
/// such lights.
at::Tensor render_textured(const c10::intrusive_ptr<BatchRenderer>& renderer, const at::Tensor& vertices,
                           const at::Tensor& colors, const at::Tensor& views, const at::Tensor& intrinsics,
                           const at::Tensor& background, const LightTensors& lights,
                           const TextureTensors& textures);

}  // namespace dpr::torch_op
