// What the Python package calls: operators that are functions of tensors, numbers and words alone, so that
// compilers of graphs can move and repeat them. A frame passes through a graph as a tensor that owns it.
#include <ATen/core/dispatch/Dispatcher.h>
#include <torch/csrc/autograd/custom_function.h>
#include <torch/library.h>

#include <array>
#include <charconv>
#include <map>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "base/name_list.hpp"
#include "dpr/aov.hpp"
#include "torch/batch.hpp"
#include "torch/batch_renderer.hpp"
#include "torch/errors.hpp"
#include "torch/light_tensors.hpp"

namespace dpr::torch_op {
namespace {

using torch::autograd::AutogradContext;
using torch::autograd::variable_list;
using Words = std::vector<std::string>;

/// Renderers by the name of their device, for as long as the process lives: OpenCL may be gone before objects
/// that the process destroys as it ends.
class Pools {
 public:
  static Pools& of_process() {
    static auto* const pools = new Pools;
    return *pools;
  }

  std::shared_ptr<RendererPool> get(const std::string& device) {
    const std::lock_guard lock(mutex_);
    std::shared_ptr<RendererPool>& pool = pools_[device];
    if (!pool) pool = std::make_shared<RendererPool>(open_device_of_process(device));
    return pool;
  }
  void clear() {
    const std::lock_guard lock(mutex_);
    for (const auto& [device, pool] : pools_) {
      if (pool) pool->clear();
    }
  }

 private:
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<RendererPool>> pools_;
};

/// "sigma=1e-3": a whole number, a number, or else a word.
void set_from_text(RenderSettings& settings, const std::string& text) {
  const std::size_t at = text.find('=');
  const std::string name = text.substr(0, at), value = at == std::string::npos ? "" : text.substr(at + 1);
  const char* const end = value.data() + value.size();
  const auto parses_as = [&](auto& number) {
    const auto [rest, error] = std::from_chars(value.data(), end, number);
    return error == std::errc() && rest == end && !value.empty();
  };
  std::int64_t whole = 0;
  double number = 0;
  if (parses_as(whole)) {
    settings.set(name, whole);
  } else if (parses_as(number)) {
    settings.set(name, number);
  } else {
    settings.set(name, value);
  }
}

RenderSettings settings_from(std::int64_t width, std::int64_t height, const Words& texts) {
  RenderSettings settings(width, height);
  for (const std::string& text : texts) set_from_text(settings, text);
  return settings;
}

/// Owned by a tensor of one byte.
struct FrameOwner {
  Frame frame;
  unsigned char byte = 0;
};

void delete_frame_owner(void* owner) { delete static_cast<FrameOwner*>(owner); }

at::Tensor tensor_of(std::unique_ptr<FrameOwner> owner) {
  FrameOwner* const raw = owner.release();
  return at::for_blob(&raw->byte, {1}).context(raw, delete_frame_owner).options(at::kByte).make_tensor();
}

Frame& frame_of(const at::Tensor& tensor) {
  const c10::Storage& storage = tensor.storage();
  if (storage.data_ptr().get_deleter() != delete_frame_owner) {
    throw InvalidArgument("frame (dpr::render)", "a copy of it", "the tensor that dpr::_render returned");
  }
  return static_cast<FrameOwner*>(storage.data_ptr().get_context())->frame;
}

/// Lights of these numbers, and of as many coefficients of harmonics and lights of each kind; none if nothing
/// is counted.
std::optional<Lights> lights_of(const at::Tensor& numbers, at::IntArrayRef counts, Lights lights) {
  if (counts.empty()) return {};
  const auto* count = counts.begin();
  lights.harmonics.resize(static_cast<std::size_t>(*count++));
  for_each_light_kind([&](auto kind) { (lights.*kind.lights).resize(static_cast<std::size_t>(*count++)); });
  return unpack(std::move(lights), checked(numbers, "lights", {-1}, "[number]"));
}

/// What dpr::_render takes beside the tensors with gradients.
struct Call {
  std::string device;
  std::int64_t width, height;
  Words settings;
  at::Tensor faces;
  /// Coefficients of harmonics, then lights of each kind; empty: unlit.
  std::vector<std::int64_t> light_counts;
  Words smoothing_names;
  std::int64_t first_view;
  bool face_colors;  ///< or of vertices
};

/// Those tensors' order in the operators.
enum Input : std::size_t { vertices, colors, views, intrinsics, background, lights, smoothing, input_count };

Inputs inputs_of(at::TensorList tensors) {
  return {tensors[vertices], tensors[colors], tensors[views], tensors[intrinsics], tensors[background]};
}

std::tuple<at::Tensor, at::Tensor> render_call(const Call& call, at::TensorList tensors,
                                               bool separate_shapes) {
  return with_torch_errors([&] {
    RenderSettings settings = settings_from(call.width, call.height, call.settings);
    const at::Tensor numbers = checked(tensors[smoothing], "smoothing", {-1}, "[number]");
    for (std::size_t i = 0; i < call.smoothing_names.size(); ++i)
      settings.set(call.smoothing_names[i], static_cast<double>(numbers.data_ptr<float>()[i]));
    const auto faces = std::make_shared<const Faces>(read_faces(call.faces));
    const Inputs in = checked(inputs_of(tensors), static_cast<std::int64_t>(faces->size()));
    std::unique_ptr<FrameOwner> owner(new FrameOwner{
        {Pools::of_process().get(call.device), topology_of(in, faces, settings, call.face_colors)}});
    Renderer& renderer = owner->frame.renderer();
    const at::Tensor image =
        render_batch(renderer, in,
                     {settings, lights_of(tensors[lights], call.light_counts, settings.lights()),
                      separate_shapes, static_cast<std::size_t>(call.first_view)});
    return std::tuple(image, tensor_of(std::move(owner)));
  });
}

/// The names' gradients out of those of sigma, gamma and alpha.
at::Tensor select_smoothing(const at::Tensor& gradients, const Words& names) {
  constexpr std::array<std::string_view, 3> k_order{"sigma", "gamma", "alpha"};
  std::vector<at::Tensor> parts{at::empty({0}, at::kFloat)};
  for (const std::string& name : names) {
    const auto place = static_cast<std::int64_t>(position_of(name, k_order, "smoothing (dpr.render)"));
    parts.push_back(gradients.narrow(0, place, 1));
  }
  return at::cat(parts);
}

/// Of dpr::_gradients: those of the tensors in their order, empty where not wanted.
std::vector<at::Tensor> gradients(const at::Tensor& frame, const at::Tensor& grad_image,
                                  at::TensorList tensors, Words smoothing_names, c10::List<bool> w) {
  return with_torch_errors([&] {
    const Wanted wanted{w[vertices],   w[colors], w[views],    w[intrinsics],
                        w[background], w[lights], w[smoothing]};
    const Gradients grad =
        backward_batch(frame_of(frame).renderer(), tensors[vertices], tensors[views], wanted, grad_image);
    std::vector<at::Tensor> all{grad.vertices,   grad.colors, grad.views,    grad.intrinsics,
                                grad.background, grad.lights, grad.smoothing};
    if (wanted.smoothing) all[smoothing] = select_smoothing(grad.smoothing, smoothing_names);
    for (at::Tensor& tensor : all) {
      if (!tensor.defined()) tensor = at::empty({0}, at::kFloat);
    }
    return all;
  });
}

/// Of dpr::_is_empty: whether no triangle of any view was rendered.
bool is_empty(const at::Tensor& frame) {
  return with_torch_errors([&] {
    const RenderStatistics statistics = frame_of(frame).renderer().statistics();
    return statistics.faces_dropped == statistics.faces;
  });
}

/// An auxiliary output of every view.
at::Tensor stack_outputs(const std::vector<AuxiliaryOutputs>& views, Aov aov) {
  const auto copy = [&](const auto& list, at::IntArrayRef channels) {
    std::vector<std::int64_t> shape{views.front().height, views.front().width};
    shape.insert(shape.end(), channels.begin(), channels.end());
    using Value = typename std::decay_t<decltype(views.front().*list)>::value_type;
    const auto type = std::is_same_v<Value, std::int32_t> ? at::kInt : at::kFloat;
    std::vector<at::Tensor> tensors;
    for (const AuxiliaryOutputs& view : views) {
      // from_blob() takes no constant memory; the copy reads it alone.
      tensors.push_back(at::from_blob(const_cast<Value*>((view.*list).data()), shape, type));
    }
    return at::stack(tensors);
  };
  switch (aov) {
    case Aov::depth:
      return copy(&AuxiliaryOutputs::depth, {});
    case Aov::normal:
      return copy(&AuxiliaryOutputs::normal, {3});
    case Aov::face_id:
      return copy(&AuxiliaryOutputs::face_id, {}).to(at::kLong);
    case Aov::barycentrics:
      return copy(&AuxiliaryOutputs::barycentrics, {3});
    case Aov::effective_faces:
      return copy(&AuxiliaryOutputs::effective_faces, {});
    case Aov::uv:
      break;
  }
  throw InvalidArgument("outputs (dpr.render)", "uv", "an output of meshes without texture coordinates");
}

/// Of dpr::_auxiliary, whose sizes are for those that compute shapes alone.
std::vector<at::Tensor> auxiliary(const at::Tensor& frame, Words names, std::int64_t, std::int64_t,
                                  std::int64_t) {
  return with_torch_errors([&] {
    Renderer& renderer = frame_of(frame).renderer();
    std::vector<AuxiliaryOutputs> views;
    for (std::size_t v = 0; v < renderer.views().size(); ++v) views.push_back(auxiliary_outputs(renderer, v));
    std::vector<at::Tensor> outputs;
    for (const std::string& name : names)
      outputs.push_back(stack_outputs(views, parse_aov(name, "outputs (dpr.render)")));
    return outputs;
  });
}

void check_settings(std::int64_t width, std::int64_t height, Words settings) {
  with_torch_errors([&] { settings_from(width, height, settings); });
}

/// The names of the kinds of lights, in their order, and how many numbers a light has.
c10::Dict<std::string, std::int64_t> light_kinds() {
  c10::Dict<std::string, std::int64_t> kinds;
  for_each_light_kind([&](auto kind) { kinds.insert(std::string(kind.key), count_numbers(kind)); });
  return kinds;
}

std::tuple<at::Tensor, at::Tensor> render_on_cpu(std::string device, std::int64_t width, std::int64_t height,
                                                 Words settings, const at::Tensor& faces,
                                                 at::TensorList tensors,
                                                 std::vector<std::int64_t> light_counts,
                                                 Words smoothing_names, std::int64_t first_view,
                                                 bool face_colors, bool separate_shapes) {
  return render_call({std::move(device), width, height, std::move(settings), faces, std::move(light_counts),
                      std::move(smoothing_names), first_view, face_colors},
                     tensors, separate_shapes);
}

/// Calls an operator below the derivatives, whatever computes it there: the renderer, or what traces a graph.
template <typename Function, typename... Arguments>
auto call_operator(const char* name, Function*, Arguments&&... arguments) {
  at::AutoDispatchBelowADInplaceOrView below;
  return c10::Dispatcher::singleton().findSchemaOrThrow(name, "").typed<Function>().call(
      std::forward<Arguments>(arguments)...);
}

struct PackageRender : public torch::autograd::Function<PackageRender> {
  static variable_list forward(AutogradContext* ctx, const Call& call, bool separate_shapes, at::Tensor v,
                               at::Tensor c, at::Tensor m, at::Tensor k, at::Tensor b, at::Tensor l,
                               at::Tensor s) {
    variable_list tensors{v, c, m, k, b, l, s};
    c10::List<bool> wanted;
    for (const at::Tensor& tensor : tensors) wanted.push_back(tensor.requires_grad());
    if (wanted[views] && call.light_counts.empty()) separate_shapes = true;
    auto [image, frame] = call_operator(
        "dpr::_render", &render_on_cpu, call.device, call.width, call.height, call.settings, call.faces,
        tensors, call.light_counts, call.smoothing_names, call.first_view, call.face_colors, separate_shapes);
    ctx->saved_data["wanted"] = wanted;
    ctx->saved_data["smoothing_names"] = call.smoothing_names;
    tensors.push_back(frame);
    ctx->save_for_backward(tensors);
    ctx->mark_non_differentiable({frame});
    return {image, frame};
  }

  static variable_list backward(AutogradContext* ctx, const variable_list& grad_outputs) {
    require_first_derivative();
    variable_list tensors = ctx->get_saved_variables();
    const at::Tensor frame = tensors.back();
    tensors.pop_back();
    const c10::List<bool> wanted = ctx->saved_data["wanted"].toBoolList();
    const variable_list found =
        call_operator("dpr::_gradients", &gradients, frame, grad_outputs[0], tensors,
                      c10::IValue(ctx->saved_data["smoothing_names"]).to<Words>(), wanted);
    variable_list grad(2);  // of the call and the flag
    for (std::size_t i = 0; i < input_count; ++i) grad.push_back(wanted[i] ? found[i] : at::Tensor());
    return grad;
  }
};

/// A compiled graph, which has its own derivatives, comes here again with the flag that its tracing found.
std::tuple<at::Tensor, at::Tensor> render_with_derivatives(std::string device, std::int64_t width,
                                                           std::int64_t height, Words settings,
                                                           const at::Tensor& faces, at::TensorList t,
                                                           std::vector<std::int64_t> light_counts,
                                                           Words smoothing_names, std::int64_t first_view,
                                                           bool face_colors, bool separate_shapes) {
  const Call call{std::move(device),          width,      height,
                  std::move(settings),        faces,      std::move(light_counts),
                  std::move(smoothing_names), first_view, face_colors};
  const variable_list outputs = PackageRender::apply(call, separate_shapes, t[vertices], t[colors], t[views],
                                                     t[intrinsics], t[background], t[lights], t[smoothing]);
  return {outputs[0], outputs[1]};
}

}  // namespace

TORCH_LIBRARY_FRAGMENT(dpr, m) {
  // inputs: vertices, colors, views, intrinsics, background, lights' numbers, smoothing's numbers.
  m.def(
      "_render(str device, int width, int height, str[] settings, Tensor faces, Tensor[] inputs, "
      "int[] light_counts, str[] smoothing_names, int first_view, bool face_colors, bool separate_shapes) "
      "-> (Tensor image, Tensor frame)");
  m.def(
      "_gradients(Tensor frame, Tensor grad_image, Tensor[] inputs, str[] smoothing_names, bool[] wanted) "
      "-> Tensor[]");
  m.def("_is_empty(Tensor frame) -> bool");
  m.def("_auxiliary(Tensor frame, str[] names, int views, int height, int width) -> Tensor[]");
  m.def("_check_settings(int width, int height, str[] settings) -> ()", &check_settings);
  m.def("_light_kinds() -> Dict(str, int)", &light_kinds);
  m.def("_release() -> ()", [] { Pools::of_process().clear(); });
}

TORCH_LIBRARY_IMPL(dpr, CPU, m) {
  m.impl("_render", &render_on_cpu);
  m.impl("_gradients", &gradients);
  m.impl("_is_empty", &is_empty);
  m.impl("_auxiliary", &auxiliary);
}

TORCH_LIBRARY_IMPL(dpr, Autograd, m) { m.impl("_render", &render_with_derivatives); }

}  // namespace dpr::torch_op
