// The operator: torch.ops.dpr.render and render_lit, and torch.classes.dpr.Renderer.
#include "torch/render.hpp"

#include <torch/csrc/autograd/custom_function.h>
#include <torch/library.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/name_list.hpp"
#include "scene/light_table.hpp"
#include "torch/batch.hpp"
#include "torch/errors.hpp"

namespace dpr::torch_op {
namespace {

using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

/// Lights whose numbers are yet to come, and a tensor of these, in their order.
struct PackedLights {
  Lights lights;
  at::Tensor numbers;
};

void require_known(const LightTensors& given) {
  std::vector<std::string_view> keys{"ambient", "harmonics"};
  for_each_light_kind([&](auto kind) { keys.push_back(kind.key); });
  for (const auto& entry : given) {
    if (std::ranges::find(keys, entry.key()) == keys.end())
      throw InvalidArgument("lights (dpr::render_lit)", "\"" + entry.key() + "\"", one_of(keys));
  }
}

/// By torch's own operations, which differentiate the packing.
PackedLights pack(const LightTensors& given, const Lights& model) {
  require_known(given);
  PackedLights packed{model, {}};
  std::vector<at::Tensor> parts;
  const auto take = [&](std::string_view key, std::initializer_list<std::int64_t> shape,
                        const std::string& expected) {
    const std::string name(key);
    if (!given.contains(name)) return std::int64_t{0};
    const at::Tensor tensor = given.at(name);
    parts.push_back(checked(tensor, "lights." + name, shape, expected.c_str()).flatten());
    return tensor.size(0);
  };
  if (take("ambient", {3}, "[3]") == 0) {
    const glm::vec3& ambient = model.ambient;
    parts.push_back(at::tensor({ambient.x, ambient.y, ambient.z}, at::kFloat));
  }
  packed.lights.harmonics.resize(
      static_cast<std::size_t>(take("harmonics", {static_cast<std::int64_t>(k_harmonics), 3}, "[9, 3]")));
  for_each_light_kind([&](auto kind) {
    const std::int64_t count = count_numbers(kind);
    (packed.lights.*kind.lights)
        .resize(
            static_cast<std::size_t>(take(kind.key, {-1, count}, "[light, " + std::to_string(count) + "]")));
  });
  packed.numbers = at::cat(parts);
  return packed;
}

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
      "render_lit(__torch__.torch.classes.dpr.Renderer renderer, Tensor vertices, Tensor colors, Tensor "
      "views, "
      "Tensor intrinsics, Tensor background, Dict(str, Tensor) lights) -> Tensor",
      &render_lit);
}

}  // namespace dpr::torch_op
