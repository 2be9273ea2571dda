// Fragment colours, unlit or lit, and their gradients.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "kernels/normals.hpp"
#include "kernels/shade.hpp"
#include "kernels/shade_lit.hpp"
#include "kernels/shade_lit_tangent.hpp"
#include "stages/bin.hpp"
#include "stages/gather.hpp"
#include "stages/geometry.hpp"
#include "stages/rasterize.hpp"
#include "stages/surface.hpp"
#include "stages/transform.hpp"

namespace dpr {

/// Options that the kernels of lit scenes are built with.
struct ShadingModel {
  Shading shading = Shading::phong;
  cl_uint lights = 0;        ///< bits of DPR_LIGHTS
  bool is_textured = false;  ///< base colours come from the surface stage, not from the corners

  bool operator==(const ShadingModel&) const = default;
};

/// The kernels of a shading model.
class LitShading {
 public:
  LitShading(Device::Impl& device, const ShadingModel& model);

  ShadingModel model;
  Launcher<kernel::normals_forward, kernel::normals_backward_normalize, kernel::normals_backward,
           kernel::normals_given_forward, kernel::normals_given_backward, kernel::normals_tangent,
           kernel::normals_given_tangent>
      normals;
  Launcher<kernel::shade_lit_forward, kernel::shade_lit_backward, kernel::shade_lit_backward_lights> shade;
  std::optional<Launcher<kernel::shade_lit_tangent>> tangent;  // made when first asked for
};

/// Everything of a frame that shading reads.
struct ShadeInputs {
  const shared::FrameParams& p;
  const DeviceViews& views;
  const Geometry& geometry;
  Transform& transform;
  const Buffer<shared::Triangle>& triangles;
  const Buffer<shared::ClippedFace>& clipped;  // where p.clips is set
  const Bin& bin;
  Rasterize& rasterize;
};

/// Vectors that triangles show at their corners, without light.
struct CornerVectors {
  const Buffer<cl_uint4>& faces;  ///< [face] indices into `values`, by corner
  const Buffer<cl_float4>& values;
};

class Shade {
 public:
  explicit Shade(Device::Impl& device) : device_(device), launch_(device) {}

  /// The lights on the device, and the kernels that they need.
  struct Lighting {
    std::shared_ptr<LitShading> kernels;  // none: colours as they are
    shared::LightingParams params{};
    Buffer<shared::Light> lights;
    std::vector<Lights> of_views;  // none: the views share them
  };

  /// Before the first textured scene.
  void make_surface();
  /// Of what a scene has not the kernels get null pointers, which they do not read.
  SurfaceArguments arguments(const ShadeInputs& in);
  SurfaceTangentArguments arguments(const ShadeInputs& in, Tangents& tangents);
  /// Everything about setting the lights that can fail. `lights`: none, those of all views, or those of each view, of
  /// which there are as many of a kind as in the others.
  Lighting prepare(std::span<const Lights> lights, bool is_textured) const;
  void set(Lighting&& prepared) noexcept { std::swap(now_, prepared); }
  bool lit() const { return now_.kernels != nullptr; }
  std::size_t lights() const { return now_.params.lights; }
  /// Those of every view by itself; empty where they share them.
  std::span<const Lights> lights_of_views() const { return now_.of_views; }
  /// Launches that find the lights' gradients: without lights one still finds the environment's.
  std::size_t light_launches() const { return std::max<std::size_t>(lights(), 1); }
  /// The first of the channels of `grad_pairs` that lit scenes have.
  std::size_t first_lit_channel() const {
    return DPR_PAIR_LIT(now_.kernels && now_.kernels->model.is_textured);
  }
  /// Number of `light_channels`.
  std::size_t light_channel_count() const;

  void forward(const ShadeInputs& in);
  /// Vectors in place of colours.
  void forward(const ShadeInputs& in, const CornerVectors& vectors);
  /// Fills the gradients of barycentrics and corner colours, if textured of texture coordinates, and, if lit,
  /// of corner positions, normals, materials and the eye.
  void backward(const ShadeInputs& in);
  /// Lists the texels that the band's fragments see, of a textured scene. After backward().
  void list_texels(const ShadeInputs& in) {
    surface->list(arguments(in), in.rasterize.pairs(in.bin), in.bin, in.rasterize);
  }
  /// Adds what goes by way of a textured scene's levels of detail to the gradients of the corners on the
  /// screen, [pair][9] as Rasterize has them, and of clipped faces as Clip has them. After backward().
  void backward_detail(const ShadeInputs& in, Buffer<float>& grad_corners, Buffer<float>& grad_clip) {
    surface->backward_detail(arguments(in), in.rasterize.pairs(in.bin), grad_corners, grad_clip);
  }
  /// Adds the gradient by way of positions and normals to d loss / d world position: [view][vertex]. Only if
  /// lit.
  void backward_world(const ShadeInputs& in, Gather& gather, Buffer<cl_float4>& grad_world);
  /// The gradients of normals that meshes give, and what those add to the models' rotations. After
  /// backward_world(). Only if lit.
  void backward_given_normals(const ShadeInputs& in);
  /// The gradients of one light, with the first those of the environment, per pair.
  void backward_light(const ShadeInputs& in, std::size_t light);

  /// Tangents of the normals, behind those of world positions. Only if lit; before tangent().
  void tangent_of_normals(const ShadeInputs& in, Tangents& tangents);
  /// From the tangents of the band's fragments' barycentrics, and of all that colours are made of, to those of
  /// colours.
  void tangent(const ShadeInputs& in, Tangents& tangents);
  /// The same of vectors, which stay as they are.
  void tangent(const ShadeInputs& in, const CornerVectors& vectors, Tangents& tangents);

  std::optional<Surface> surface;        ///< of textured scenes: made for the first of them
  Buffer<float> grad_pairs;              ///< [p.pairs] of each DPR_PAIR_...
  Buffer<cl_float4> grad_given_normals;  ///< [value] of given normals
  Buffer<float> normal_channels;         ///< [3][view][given] of models' rotation vectors
  Buffer<float> light_channels;          ///< [light_channel_count()][pair], of the environment, then by light

  std::size_t bytes() const;

 private:
  Device::Impl& device_;
  Launcher<kernel::shade_forward, kernel::shade_backward, kernel::shade_tangent> launch_;
  void interpolate(const ShadeInputs& in, const shared::FrameParams& p, const CornerVectors& colors);
  void interpolate_tangent(const ShadeInputs& in, const shared::FrameParams& p, const CornerVectors& colors,
                           const shared::TangentParams& q, Tangents& tangents);
  bool is_flat() const { return now_.kernels->model.shading == Shading::flat; }
  void find_normals(const ShadeInputs& in);

  Lighting now_;
  Buffer<cl_float4> grad_normals_;  // [view][normal]
};

}  // namespace dpr
