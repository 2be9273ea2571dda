// A batch of tensors rendered into a frame, and the gradients of what was rendered.
#pragma once

#include <ATen/core/Tensor.h>

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "dpr/light.hpp"
#include "torch/render_settings.hpp"
#include "torch/renderer_pool.hpp"
#include "torch/texture_tensors.hpp"

namespace dpr::torch_op {

/// A batch's tensors, as render() takes them (torch/render.hpp).
struct Inputs {
  at::Tensor vertices, colors, views, intrinsics, background;
  SurfaceNumbers surface = {};
};

/// The same, contiguous. Throws InvalidArgument for types, devices and shapes that do not fit.
Inputs checked(const Inputs& in, std::int64_t faces);

/// The views of checked inputs.
std::vector<View> make_views(const Inputs& in, const RenderSettings& settings);

/// How a batch is rendered.
struct BatchOptions {
  const RenderSettings& settings;
  std::optional<Lights> lights = {};
  /// Vertices are uploaded for every view, also where they are the same: for the gradients of the views'
  /// matrices.
  bool separate_shapes = false;
  /// Of a larger batch, the views that come before these: sampled noise is that of the larger batch.
  std::size_t first_view = 0;
};

/// What a batch's meshes have in common, beside their sizes.
struct MeshForm {
  std::shared_ptr<const Faces> faces;
  bool face_colors = false;
  SurfaceLayout surface = {};
};

/// The renderer's topology for checked inputs. Throws InvalidArgument for a surface that does not fit them.
Topology topology_of(const Inputs& in, MeshForm form, const RenderSettings& settings);
/// The images of checked inputs, float32 [view, height, width, 4].
at::Tensor render_batch(Renderer& renderer, const Inputs& in, const BatchOptions& options);

/// Which tensors need a gradient.
struct Wanted {
  bool vertices = false, colors = false, views = false, intrinsics = false, background = false,
       lights = false, smoothing = false;
  WantedOfSurface surface = {};
};

/// Which motions the gradients of the views' matrices are right for. Those of any affine matrices are
/// computed from those of every view's vertices, where nothing else depends on the views. Lights, and what is
/// measured in world space, stay where they are: with them the gradients are those of rigid motions.
enum class ViewMotion { affine, rigid };

GradientRequest request_of(const Wanted& wanted, ViewMotion motion);

/// Undefined where not wanted. float32, of the tensors' shapes.
struct Gradients {
  at::Tensor vertices, colors, views, intrinsics, background;
  at::Tensor lights;     ///< [number], in the order of for_each_light_number()
  at::Tensor smoothing;  ///< [3]: sigma, gamma, alpha
  SurfaceNumbers surface;
};

/// From what a backward pass of a renderer with these vertices and views has found.
Gradients gather_gradients(const Renderer& renderer, SceneGradient& gradient, const at::Tensor& vertices,
                           const at::Tensor& views, const Wanted& wanted, ViewMotion motion);

/// Of the renderer's last frame, of these vertices and views. Throws the library's errors.
Gradients backward_batch(Renderer& renderer, const at::Tensor& vertices, const at::Tensor& views,
                         const Wanted& wanted, const at::Tensor& grad_image);

/// Throws c10::Error where a derivative of a derivative is asked for.
void require_first_derivative();

}  // namespace dpr::torch_op
