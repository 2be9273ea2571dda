// The operator: torch.ops.dpr.render and render_lit, and torch.classes.dpr.Renderer.
#include "torch/render.hpp"

#include <torch/csrc/autograd/custom_function.h>
#include <torch/library.h>

#include <chrono>
#include <optional>
#include <utility>

#include "torch/batch.hpp"
#include "torch/errors.hpp"
#include "torch/light_tensors.hpp"

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

struct RenderFunction : public torch::autograd::Function<RenderFunction> {
  static at::Tensor forward(AutogradContext* ctx, const c10::intrusive_ptr<BatchRenderer>& batch,
                            const at::Tensor& vertices, const at::Tensor& colors, const at::Tensor& views,
                            const at::Tensor& intrinsics, const at::Tensor& background,
                            const at::Tensor& light_numbers, const std::optional<Lights>& lights) {
    const Timer timer(*batch);
    return with_torch_errors([&] {
      const RenderSettings& settings = batch->settings();
      const Inputs in = checked({vertices, colors, views, intrinsics, background},
                                static_cast<std::int64_t>(batch->faces()->size()));
      auto lease = c10::make_intrusive<Lease>(
          batch->pool(), topology_of(in, batch->faces(), settings, in.colors.size(1) != in.vertices.size(1)));
      BatchOptions options{settings};
      if (lights) options.lights = unpack(*lights, light_numbers);
      options.separate_shapes = views.requires_grad() && !lights;
      const at::Tensor image = render_batch(lease->frame.renderer(), in, options);
      c10::List<bool> wanted;
      for (const at::Tensor* tensor : {&vertices, &colors, &views, &intrinsics, &background, &light_numbers})
        wanted.push_back(tensor->requires_grad());
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
      const Wanted wanted{w[0], w[1], w[2], w[3], w[4], w[5]};
      const Gradients grad =
          backward_batch(lease.frame.renderer(), saved[0], saved[1], wanted, grad_outputs[0]);
      // The renderer and the lights' structure have none.
      return variable_list{
          {}, grad.vertices, grad.colors, grad.views, grad.intrinsics, grad.background, grad.lights, {}};
    });
  }
};

}  // namespace

at::Tensor render(const c10::intrusive_ptr<BatchRenderer>& renderer, const at::Tensor& vertices,
                  const at::Tensor& colors, const at::Tensor& views, const at::Tensor& intrinsics,
                  const at::Tensor& background) {
  return RenderFunction::apply(renderer, vertices, colors, views, intrinsics, background,
                               at::empty({0}, at::kFloat), std::optional<Lights>());
}

at::Tensor render_lit(const c10::intrusive_ptr<BatchRenderer>& renderer, const at::Tensor& vertices,
                      const at::Tensor& colors, const at::Tensor& views, const at::Tensor& intrinsics,
                      const at::Tensor& background, const LightTensors& lights) {
  const PackedLights packed = with_torch_errors([&] { return pack(lights, renderer->settings().lights()); });
  return RenderFunction::apply(renderer, vertices, colors, views, intrinsics, background, packed.numbers,
                               std::optional<Lights>(packed.lights));
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
}

}  // namespace dpr::torch_op
