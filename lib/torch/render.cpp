// The operator: torch.ops.dpr.render, render_lit and render_textured, and torch.classes.dpr.Renderer.
#include "torch/render.hpp"

#include <torch/csrc/autograd/custom_function.h>
#include <torch/library.h>

#include <chrono>
#include <optional>
#include <utility>

#include "torch/batch.hpp"
#include "torch/errors.hpp"
#include "torch/light_tensors.hpp"
#include "torch/texture_tensors.hpp"

namespace dpr::torch_op {
namespace {

using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

using Clock = std::chrono::steady_clock;

/// Adds the time of its life to a batch's.
class Timer {
 public:
  explicit Timer(BatchRenderer& batch) : batch_(batch) {}
  ~Timer() { batch_.add_seconds(std::chrono::duration<double>(Clock::now() - start_).count()); }
  Timer(const Timer&) = delete;
  Timer& operator=(const Timer&) = delete;

 private:
  BatchRenderer& batch_;
  Clock::time_point start_ = Clock::now();
};

/// The frame of a graph, which is given back with it.
struct Lease : torch::CustomClassHolder {
  Lease(std::shared_ptr<RendererPool> pool, Topology topology)
      : frame(std::move(pool), std::move(topology)) {}
  Frame frame;
};

/// What views are rendered with beside the tensors with gradients.
struct Description {
  std::optional<Lights> lights;
  SurfaceLayout surface;
  std::int64_t first_view = 0;
};

/// Those tensors' order, as torch has them.
struct OfBatch {
  enum Input : std::size_t {
    vertices,
    colors,
    views,
    intrinsics,
    background,
    light_numbers,
    texcoords,
    texels,
    specular,
    shininess
  };
};

variable_list tensors_of(const Inputs& in, const at::Tensor& light_numbers) {
  return {in.vertices,          in.colors,         in.views,
          in.intrinsics,        in.background,     light_numbers,
          in.surface.texcoords, in.surface.texels, in.surface.specular,
          in.surface.shininess};
}

struct RenderFunction : public torch::autograd::Function<RenderFunction> {
  using In = OfBatch;

  static at::Tensor forward(AutogradContext* ctx, const c10::intrusive_ptr<BatchRenderer>& batch,
                            const Description& described, const at::TensorList& t) {
    const Timer timer(*batch);
    return with_torch_errors([&] {
      const RenderSettings& settings = batch->settings();
      const Inputs in = checked({t[In::vertices],
                                 t[In::colors],
                                 t[In::views],
                                 t[In::intrinsics],
                                 t[In::background],
                                 {t[In::texcoords], t[In::texels], t[In::specular], t[In::shininess]}},
                                static_cast<std::int64_t>(batch->faces()->size()));
      const bool face_colors = in.colors.size(1) != in.vertices.size(1);
      auto lease = c10::make_intrusive<Lease>(
          batch->pool(), topology_of(in, {batch->faces(), face_colors, described.surface}, settings));
      BatchOptions options{settings};
      if (described.lights) options.lights = unpack(*described.lights, t[In::light_numbers]);
      options.separate_shapes = t[In::views].requires_grad() && !described.lights;
      options.first_view = static_cast<std::size_t>(described.first_view);
      const at::Tensor image = render_batch(lease->frame.renderer(), in, options);
      c10::List<bool> wanted;
      for (const at::Tensor& tensor : t) wanted.push_back(tensor.requires_grad());
      ctx->saved_data["wanted"] = wanted;
      ctx->saved_data["batch"] = batch;
      ctx->saved_data["lease"] = c10::IValue::make_capsule(std::move(lease));
      ctx->save_for_backward({in.vertices, in.views});
      return image;
    });
  }

  static variable_list backward(AutogradContext* ctx, const variable_list& grad_outputs) {
    require_first_derivative();
    const auto batch = ctx->saved_data["batch"].toCustomClass<BatchRenderer>();
    const Timer timer(*batch);
    return with_torch_errors([&] {
      auto& lease = static_cast<Lease&>(*ctx->saved_data["lease"].toCapsule());
      const variable_list saved = ctx->get_saved_variables();
      const c10::List<bool> w = ctx->saved_data["wanted"].toBoolList();
      const Wanted wanted{w[In::vertices],
                          w[In::colors],
                          w[In::views],
                          w[In::intrinsics],
                          w[In::background],
                          w[In::light_numbers],
                          false,
                          {w[In::texcoords], w[In::texels], w[In::specular], w[In::shininess]}};
      const Gradients grad =
          backward_batch(lease.frame.renderer(), saved[0], saved[1], wanted, grad_outputs[0]);
      variable_list all(2);  // of the renderer and the description
      for (const at::Tensor& tensor : tensors_of(
               {grad.vertices, grad.colors, grad.views, grad.intrinsics, grad.background, grad.surface},
               grad.lights))
        all.push_back(tensor);
      return all;
    });
  }
};

using BatchPointer = c10::intrusive_ptr<BatchRenderer>;

/// Views that have lights and textures in common, of which `first_view` come before in their batch.
at::Tensor render_together(const BatchPointer& renderer, Inputs in, const LightTensors* lights,
                           const TextureTensors& textures, std::int64_t first_view) {
  PackedSurface surface = pack(textures);
  in.surface = surface.numbers;
  PackedLights packed{{}, at::empty({0}, at::kFloat)};
  if (lights) packed = pack(*lights, renderer->settings().lights());
  const Description described{lights ? std::optional(packed.lights) : std::nullopt, surface.layout,
                              first_view};
  return RenderFunction::apply(renderer, described, at::TensorList(tensors_of(in, packed.numbers)));
}

/// Of checked inputs.
Inputs inputs_of_view(const Inputs& in, const ViewOfBatch& view) {
  const auto own = [&](const at::Tensor& tensor) {
    return tensor.size(0) == 1 ? tensor : tensor.narrow(0, view.index, 1);
  };
  return {own(in.vertices), own(in.colors), own(in.views), own(in.intrinsics), in.background};
}

at::Tensor render_batch_of(const BatchPointer& renderer, const Inputs& in, const LightTensors* lights,
                           const TextureTensors& textures) {
  return with_torch_errors([&] {
    if (!(lights && is_of_views(*lights)) && !is_of_views(textures))
      return render_together(renderer, in, lights, textures, 0);
    const Inputs all = checked(in, static_cast<std::int64_t>(renderer->faces()->size()));
    std::vector<at::Tensor> images;
    for (ViewOfBatch view{0, all.views.size(0)}; view.index < view.count; ++view.index) {
      const LightTensors own = lights ? of_view(*lights, view) : LightTensors();
      images.push_back(render_together(renderer, inputs_of_view(all, view), lights ? &own : nullptr,
                                       of_view(textures, view), view.index));
    }
    return at::cat(images);
  });
}

}  // namespace

at::Tensor render(const c10::intrusive_ptr<BatchRenderer>& renderer, const at::Tensor& vertices,
                  const at::Tensor& colors, const at::Tensor& views, const at::Tensor& intrinsics,
                  const at::Tensor& background) {
  return render_batch_of(renderer, {vertices, colors, views, intrinsics, background}, nullptr,
                         TextureTensors());
}

at::Tensor render_lit(const c10::intrusive_ptr<BatchRenderer>& renderer, const at::Tensor& vertices,
                      const at::Tensor& colors, const at::Tensor& views, const at::Tensor& intrinsics,
                      const at::Tensor& background, const LightTensors& lights) {
  return render_batch_of(renderer, {vertices, colors, views, intrinsics, background}, &lights,
                         TextureTensors());
}

at::Tensor render_textured(const c10::intrusive_ptr<BatchRenderer>& renderer, const at::Tensor& vertices,
                           const at::Tensor& colors, const at::Tensor& views, const at::Tensor& intrinsics,
                           const at::Tensor& background, const LightTensors& lights,
                           const TextureTensors& textures) {
  return render_batch_of(renderer, {vertices, colors, views, intrinsics, background},
                         lights.empty() ? nullptr : &lights, textures);
}

TORCH_LIBRARY(dpr, m) {
  m.class_<BatchRenderer>("Renderer")
      .def(torch::init<const at::Tensor&, std::int64_t, std::int64_t, const std::string&,
                       const std::string&>(),
           "Faces, image size, smoothing and device of a batch",
           {torch::arg("faces"), torch::arg("width"), torch::arg("height"),
            torch::arg("preset") = std::string("pixel"), torch::arg("device") = std::string()})
      .def("set", &BatchRenderer::set,
           "Sets a value of the smoothing or the camera, by its key in a scene file",
           {torch::arg("name"), torch::arg("value")})
      .def("seconds", &BatchRenderer::seconds);
  m.def(
      "render(__torch__.torch.classes.dpr.Renderer renderer, Tensor vertices, Tensor colors, Tensor views, "
      "Tensor intrinsics, Tensor background) -> Tensor",
      &render);
  m.def(
      "render_lit(__torch__.torch.classes.dpr.Renderer renderer, Tensor vertices, Tensor colors, "
      "Tensor views, Tensor intrinsics, Tensor background, Dict(str, Tensor) lights) -> Tensor",
      &render_lit);
  m.def(
      "render_textured(__torch__.torch.classes.dpr.Renderer renderer, Tensor vertices, Tensor colors, "
      "Tensor views, Tensor intrinsics, Tensor background, Dict(str, Tensor) lights, Tensor[] textures, "
      "Dict(str, Tensor) surface, str[] wraps, str[] filters) -> Tensor",
      [](const BatchPointer& renderer, const at::Tensor& vertices, const at::Tensor& colors,
         const at::Tensor& views, const at::Tensor& intrinsics, const at::Tensor& background,
         const LightTensors& lights, const std::vector<at::Tensor>& textures, const NamedTensors& surface,
         std::vector<std::string> wraps, std::vector<std::string> filters) {
        return render_textured(renderer, vertices, colors, views, intrinsics, background, lights,
                               {textures, surface, std::move(wraps), std::move(filters)});
      });
}

}  // namespace dpr::torch_op
