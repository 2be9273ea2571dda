#include "learn/mesh_renderer.hpp"

#include <torch/csrc/autograd/custom_function.h>
#include <torch/custom_class.h>

#include <string>
#include <utility>

#include "base/clock.hpp"
#include "batch/batch.hpp"

namespace dpr::learn {
namespace {

using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

/// Adds the time that an action takes; the library's errors become torch's.
template <typename Action>
auto timed(double& seconds, const Action& action) {
  const Clock::time_point start = Clock::now();
  try {
    auto result = action();
    seconds += seconds_since(start);
    return result;
  } catch (const Error& error) {
    throw RenderError(error);
  }
}

/// The memory of a contiguous tensor.
batch::NamedArray array_of(const char* name, const at::Tensor& tensor) {
  return {name,
          tensor.data_ptr<float>(),
          batch::Element::float32,
          {tensor.sizes().begin(), tensor.sizes().end()}};
}

/// The frame of a graph, which is given back with it.
struct Lease : torch::CustomClassHolder {
  template <typename... Arguments>
  explicit Lease(Arguments&&... arguments) : batch(std::forward<Arguments>(arguments)...) {}
  batch::Batch batch;
};

}  // namespace

RenderError::RenderError(const dpr::Error& error)
    : c10::Error(std::string("dpr: error: ") + error.what(), /*backtrace=*/{}),  // a string, later a pointer
      original_(std::current_exception()) {}

struct MeshRenderer::Function : public torch::autograd::Function<Function> {
  static at::Tensor forward(AutogradContext* ctx, const std::shared_ptr<MeshRenderer>& owner,
                            const at::Tensor& vertices, const at::Tensor& colors, const at::Tensor& views,
                            const at::Tensor& intrinsics) {
    return timed(owner->seconds_, [&] {
      const std::vector<at::Tensor> kept{vertices.contiguous(), colors.contiguous(), views.contiguous(),
                                         intrinsics.contiguous()};
      std::vector<batch::NamedArray> arrays{array_of("vertices", kept[0]), array_of("colors", kept[1]),
                                            array_of("views", kept[2]), array_of("intrinsics", kept[3])};
      arrays.push_back({"faces", owner->faces_.data(), batch::Element::int32, {owner->faces_.size() / 3, 3}});
      const batch::BatchOptions options{owner->settings_, false, 0, {"vertices", "colors"}};
      auto lease = c10::make_intrusive<Lease>(owner->pool_, arrays, options);
      const at::Tensor image =
          at::empty({views.size(0), owner->settings_.height(), owner->settings_.width(), 4}, at::kFloat);
      lease->batch.read(std::vector{array_of("image", image)});
      ctx->saved_data["lease"] = c10::IValue::make_capsule(std::move(lease));
      // A capsule again: torch saves no other pointer.
      ctx->saved_data["owner"] = c10::IValue::make_capsule(c10::make_intrusive<Owner>(owner));
      ctx->save_for_backward({vertices, colors});
      return image;
    });
  }

  static variable_list backward(AutogradContext* ctx, const variable_list& grad_outputs) {
    const auto& owner = static_cast<Owner&>(*ctx->saved_data["owner"].toCapsule()).renderer;
    return timed(owner->seconds_, [&] {
      auto& lease = static_cast<Lease&>(*ctx->saved_data["lease"].toCapsule());
      const variable_list saved = ctx->get_saved_variables();
      const at::Tensor grad = grad_outputs[0].contiguous();
      const at::Tensor vertices = at::empty(saved[0].sizes(), at::kFloat),
                       colors = at::empty(saved[1].sizes(), at::kFloat);
      lease.batch.backward(std::vector{array_of("image", grad)},
                           std::vector{array_of("vertices", vertices), array_of("colors", colors)});
      return variable_list{{}, vertices, colors, {}, {}};
    });
  }

  struct Owner : torch::CustomClassHolder {
    explicit Owner(std::shared_ptr<MeshRenderer> renderer_) : renderer(std::move(renderer_)) {}
    std::shared_ptr<MeshRenderer> renderer;
  };
};

MeshRenderer::MeshRenderer(const batch::Faces& faces, int size, const Smoothing& smoothing,
                           const Device& device)
    : settings_(size, size), pool_(std::make_shared<batch::RendererPool>(device)) {
  for (const glm::uvec3& face : faces)
    for (int k = 0; k < 3; ++k) faces_.push_back(static_cast<std::int32_t>(face[k]));
  settings_.set("znear", static_cast<double>(Camera().znear));
  settings_.set("zfar", static_cast<double>(Camera().zfar));
  set_smoothing(smoothing);
}

at::Tensor MeshRenderer::render(const at::Tensor& vertices, const at::Tensor& colors, const at::Tensor& views,
                                const at::Tensor& intrinsics) {
  return Function::apply(shared_from_this(), vertices, colors, views, intrinsics);
}

}  // namespace dpr::learn
