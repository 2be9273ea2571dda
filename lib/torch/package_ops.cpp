// What the Python package calls: operators that are functions of tensors, numbers and words alone, so that
// compilers of graphs can move and repeat them. A frame passes through a graph as a tensor that owns it.
#include <torch/csrc/autograd/custom_function.h>
#include <torch/library.h>

#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "dpr/aov.hpp"
#include "renderer/renderer_impl.hpp"
#include "torch/batch.hpp"
#include "torch/errors.hpp"
#include "torch/frame_tensors.hpp"
#include "torch/index_tensors.hpp"
#include "torch/light_tensors.hpp"
#include "torch/output_tensors.hpp"
#include "torch/package_calls.hpp"

namespace dpr::torch_op {
namespace {

using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

/// What dpr::_render takes beside the tensors with gradients.
struct Call {
  std::string device;
  std::int64_t width, height;
  Words settings;
  /// int64: faces, and face_texcoords, face_textures, face_materials, empty where there are none.
  std::vector<at::Tensor> indices;
  /// Coefficients of harmonics, then lights of each kind; empty: unlit.
  std::vector<std::int64_t> light_counts;
  std::vector<std::int64_t> texture_sizes;  ///< height and width of each
  Words wraps, filters;
  Words smoothing_names;
  std::int64_t first_view;
  bool face_colors;  ///< or of vertices
};

/// Those tensors' order in the operators.
enum Input : std::size_t {
  vertices,
  colors,
  views,
  intrinsics,
  background,
  lights,
  smoothing,
  texcoords,
  texels,
  specular,
  shininess,
  input_count
};

/// Sets what the tensor has a number of, by its name.
void set_numbers(RenderSettings& settings, const Words& names, const at::Tensor& tensor) {
  const at::Tensor numbers = checked(tensor, "smoothing", {-1}, "[number]");
  if (numbers.numel() != static_cast<std::int64_t>(names.size())) {
    throw InvalidArgument("smoothing_names (dpr::_render)", std::to_string(names.size()) + " names",
                          std::to_string(numbers.numel()) + ", one a number");
  }
  for (std::size_t i = 0; i < names.size(); ++i)
    settings.set(names[i], static_cast<double>(numbers.data_ptr<float>()[i]));
}

Inputs inputs_of(at::TensorList tensors) {
  return {tensors[vertices],   tensors[colors],
          tensors[views],      tensors[intrinsics],
          tensors[background], {tensors[texcoords], tensors[texels], tensors[specular], tensors[shininess]}};
}

MeshForm mesh_form(const Call& call) {
  constexpr std::size_t k_indices = 4;
  require_count(call.indices.size(), k_indices, "indices (dpr::_render)");
  return {std::make_shared<const Faces>(read_faces(call.indices[0], "faces (dpr::Renderer)")),
          call.face_colors,
          {call.indices[1], call.indices[2], call.indices[3], call.texture_sizes, call.wraps, call.filters}};
}

std::tuple<at::Tensor, at::Tensor> render_call(const Call& call, at::TensorList tensors,
                                               bool separate_shapes) {
  return with_torch_errors([&] {
    require_count(tensors.size(), input_count, "inputs (dpr::_render)");
    RenderSettings settings = settings_from_texts(call.width, call.height, call.settings);
    set_numbers(settings, call.smoothing_names, tensors[smoothing]);
    MeshForm form = mesh_form(call);
    const Inputs in = checked(inputs_of(tensors), static_cast<std::int64_t>(form.faces->size()));
    auto frame = std::make_unique<Frame>(RendererPools::of_process().get(call.device),
                                         topology_of(in, std::move(form), settings));
    const at::Tensor image =
        render_batch(frame->renderer(), in,
                     {settings, unpack_counted(tensors[lights], call.light_counts, settings.lights()),
                      separate_shapes, static_cast<std::size_t>(call.first_view)});
    return std::tuple(image, tensor_of(std::move(frame)));
  });
}

/// Of dpr::_gradients: those of the tensors in their order, empty where not wanted.
std::vector<at::Tensor> gradients(const at::Tensor& frame, const at::Tensor& grad_image,
                                  at::TensorList tensors, Words smoothing_names, c10::List<bool> w) {
  return with_torch_errors([&] {
    require_count(tensors.size(), input_count, "inputs (dpr::_gradients)");
    require_count(w.size(), input_count, "wanted (dpr::_gradients)");
    const Wanted wanted{
        w[vertices],   w[colors], w[views],     w[intrinsics],
        w[background], w[lights], w[smoothing], {w[texcoords], w[texels], w[specular], w[shininess]}};
    const Gradients grad =
        backward_batch(frame_of(frame).renderer(), tensors[vertices], tensors[views], wanted, grad_image);
    const SurfaceNumbers& surface = grad.surface;
    std::vector<at::Tensor> all{grad.vertices,   grad.colors,      grad.views,       grad.intrinsics,
                                grad.background, grad.lights,      grad.smoothing,   surface.texcoords,
                                surface.texels,  surface.specular, surface.shininess};
    if (wanted.smoothing) all[smoothing] = select_smoothing(grad.smoothing, smoothing_names);
    for (at::Tensor& tensor : all) {
      if (!tensor.defined()) tensor = at::empty({0}, at::kFloat);
    }
    return all;
  });
}

/// Of dpr::_is_empty: whether no triangle of any view was rendered. The statistics read a word of every
/// triangle from the device, which only a frame without fragments needs.
bool is_empty(const at::Tensor& frame) {
  return with_torch_errors([&] {
    const Renderer& renderer = frame_of(frame).renderer();
    renderer.impl().require_forward("dpr::_is_empty");
    if (renderer.impl().rasterize.frame_fragments > 0) return false;
    const RenderStatistics statistics = renderer.statistics();
    return statistics.faces_dropped == statistics.faces;
  });
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
  with_torch_errors([&] { settings_from_texts(width, height, settings); });
}

/// The names of the kinds of lights, in their order, and how many numbers a light has.
c10::Dict<std::string, std::int64_t> light_kinds() {
  c10::Dict<std::string, std::int64_t> kinds;
  for_each_light_kind([&](auto kind) { kinds.insert(std::string(kind.key), count_numbers(kind)); });
  return kinds;
}

std::tuple<at::Tensor, at::Tensor> render_on_cpu(
    std::string device, std::int64_t width, std::int64_t height, Words settings, at::TensorList indices,
    at::TensorList inputs, std::vector<std::int64_t> light_counts, std::vector<std::int64_t> texture_sizes,
    Words wraps, Words filters, Words smoothing_names, std::int64_t first_view, bool face_colors,
    bool separate_shapes) {
  return render_call({std::move(device), width, height, std::move(settings), indices.vec(),
                      std::move(light_counts), std::move(texture_sizes), std::move(wraps), std::move(filters),
                      std::move(smoothing_names), first_view, face_colors},
                     inputs, separate_shapes);
}

struct PackageRender : public torch::autograd::Function<PackageRender> {
  static variable_list forward(AutogradContext* ctx, const Call& call, bool separate_shapes,
                               const at::TensorList& inputs) {
    c10::List<bool> wanted;
    for (const at::Tensor& tensor : inputs) wanted.push_back(tensor.requires_grad());
    if (wanted[views] && call.light_counts.empty()) separate_shapes = true;
    auto [image, frame] =
        call_operator("dpr::_render", &render_on_cpu, call.device, call.width, call.height, call.settings,
                      call.indices, inputs, call.light_counts, call.texture_sizes, call.wraps, call.filters,
                      call.smoothing_names, call.first_view, call.face_colors, separate_shapes);
    variable_list tensors = inputs.vec();
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
std::tuple<at::Tensor, at::Tensor> render_with_derivatives(
    std::string device, std::int64_t width, std::int64_t height, Words settings, at::TensorList indices,
    at::TensorList inputs, std::vector<std::int64_t> light_counts, std::vector<std::int64_t> texture_sizes,
    Words wraps, Words filters, Words smoothing_names, std::int64_t first_view, bool face_colors,
    bool separate_shapes) {
  with_torch_errors([&] { require_count(inputs.size(), input_count, "inputs (dpr::_render)"); });
  const Call call{std::move(device),
                  width,
                  height,
                  std::move(settings),
                  indices.vec(),
                  std::move(light_counts),
                  std::move(texture_sizes),
                  std::move(wraps),
                  std::move(filters),
                  std::move(smoothing_names),
                  first_view,
                  face_colors};
  const variable_list outputs = PackageRender::apply(call, separate_shapes, inputs);
  return {outputs[0], outputs[1]};
}

}  // namespace

TORCH_LIBRARY_FRAGMENT(dpr, m) {
  // indices: as Call has them. inputs: as Input has them, of lights and smoothing the numbers.
  m.def(
      "_render(str device, int width, int height, str[] settings, Tensor[] indices, Tensor[] inputs, "
      "int[] light_counts, int[] texture_sizes, str[] wraps, str[] filters, str[] smoothing_names, "
      "int first_view, bool face_colors, bool separate_shapes) -> (Tensor image, Tensor frame)");
  m.def(
      "_gradients(Tensor frame, Tensor grad_image, Tensor[] inputs, str[] smoothing_names, bool[] wanted) "
      "-> Tensor[]");
  m.def("_is_empty(Tensor frame) -> bool");
  m.def("_auxiliary(Tensor frame, str[] names, int views, int height, int width) -> Tensor[]");
  m.def("_check_settings(int width, int height, str[] settings) -> ()", &check_settings);
  m.def("_light_kinds() -> Dict(str, int)", &light_kinds);
  m.def("_release() -> ()", [] { RendererPools::of_process().clear(); });
}

TORCH_LIBRARY_IMPL(dpr, CPU, m) {
  m.impl("_render", &render_on_cpu);
  m.impl("_gradients", &gradients);
  m.impl("_is_empty", &is_empty);
  m.impl("_auxiliary", &auxiliary);
}

TORCH_LIBRARY_IMPL(dpr, Autograd, m) { m.impl("_render", &render_with_derivatives); }

}  // namespace dpr::torch_op
