// The outputs that have gradients, for the Python package.
#include <torch/csrc/autograd/custom_function.h>
#include <torch/library.h>

#include <array>
#include <utility>
#include <vector>

#include "torch/attribute_tensors.hpp"
#include "torch/errors.hpp"
#include "torch/frame_tensors.hpp"
#include "torch/package_calls.hpp"

namespace dpr::torch_op {
namespace {

using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

/// The tensors with gradients in the operators' order, of the smoothing the numbers.
struct OfGeometry {
  enum Input : std::size_t { vertices, views, intrinsics, smoothing, texcoords, count };
};

Wanted wanted_of_geometry(const c10::List<bool>& wanted) {
  require_count(wanted.size(), OfGeometry::count, "wanted (dpr::_attributes)");
  Wanted result;
  result.vertices = wanted[OfGeometry::vertices];
  result.views = wanted[OfGeometry::views];
  result.intrinsics = wanted[OfGeometry::intrinsics];
  result.smoothing = wanted[OfGeometry::smoothing];
  result.surface.texcoords = wanted[OfGeometry::texcoords];
  return result;
}

Attribute attribute_of(const std::string& name) { return parse_attribute(name, "outputs (dpr.render)"); }

/// Of dpr::_attributes, whose sizes and inputs are for those that compute shapes and derivatives.
std::vector<at::Tensor> render_attributes(const at::Tensor& frame, Words names, at::TensorList, Words,
                                          c10::List<bool> wanted, std::int64_t, std::int64_t, std::int64_t) {
  return with_torch_errors([&] {
    std::vector<at::Tensor> images;
    for (const std::string& name : names)
      images.push_back(render_attribute(frame_of(frame), attribute_of(name), wanted_of_geometry(wanted)));
    return images;
  });
}

/// Of dpr::_attribute_gradients: those of the inputs in their order, empty where not wanted. The gradient of
/// an image that nothing depends on is empty. `images` say that they were rendered before.
std::vector<at::Tensor> attribute_gradients(const at::Tensor& frame, Words names, at::TensorList grad_images,
                                            at::TensorList /*images*/, at::TensorList inputs,
                                            Words smoothing_names, c10::List<bool> wanted) {
  return with_torch_errors([&] {
    require_count(grad_images.size(), names.size(), "grad_images (dpr::_attribute_gradients)");
    require_count(inputs.size(), OfGeometry::count, "inputs (dpr::_attribute_gradients)");
    const Wanted of_geometry = wanted_of_geometry(wanted);
    std::vector<at::Tensor> all;
    for (std::size_t i = 0; i < OfGeometry::count; ++i)
      all.push_back(wanted[i] ? at::zeros_like(inputs[i]) : at::empty({0}, at::kFloat));
    for (std::size_t n = 0; n < names.size(); ++n) {
      if (grad_images[n].numel() == 0) continue;
      Gradients grad =
          backward_attribute(frame_of(frame), attribute_of(names[n]), grad_images[n],
                             inputs[OfGeometry::vertices], inputs[OfGeometry::views], of_geometry);
      if (of_geometry.smoothing) grad.smoothing = select_smoothing(grad.smoothing, smoothing_names);
      const std::array found{grad.vertices, grad.views, grad.intrinsics, grad.smoothing,
                             grad.surface.texcoords};
      for (std::size_t i = 0; i < found.size(); ++i) {
        if (found[i].defined()) all[i] += found[i];
      }
    }
    return all;
  });
}

struct PackageAttributes : public torch::autograd::Function<PackageAttributes> {
  static variable_list forward(AutogradContext* ctx, const at::Tensor& frame, const Words& names,
                               const at::TensorList& inputs, const Words& smoothing_names,
                               c10::List<bool> wanted, const std::array<std::int64_t, 3>& size) {
    variable_list images = call_operator("dpr::_attributes", &render_attributes, frame, names, inputs,
                                         smoothing_names, wanted, size[0], size[1], size[2]);
    ctx->set_materialize_grads(false);
    ctx->saved_data["wanted"] = wanted;
    ctx->saved_data["names"] = names;
    ctx->saved_data["smoothing_names"] = smoothing_names;
    variable_list saved = inputs.vec();
    saved.push_back(frame);
    saved.insert(saved.end(), images.begin(), images.end());
    ctx->save_for_backward(saved);
    return images;
  }

  static variable_list backward(AutogradContext* ctx, variable_list grad_images) {
    require_first_derivative();
    const variable_list saved = ctx->get_saved_variables();
    const at::TensorList all(saved), inputs = all.slice(0, OfGeometry::count);
    const c10::List<bool> wanted = ctx->saved_data["wanted"].toBoolList();
    for (at::Tensor& grad : grad_images) {
      if (!grad.defined()) grad = at::empty({0}, at::kFloat);
    }
    const variable_list found =
        call_operator("dpr::_attribute_gradients", &attribute_gradients, all[OfGeometry::count],
                      c10::IValue(ctx->saved_data["names"]).to<Words>(), at::TensorList(grad_images),
                      all.slice(OfGeometry::count + 1), inputs,
                      c10::IValue(ctx->saved_data["smoothing_names"]).to<Words>(), wanted);
    variable_list grad(2);  // of the frame and the names
    for (std::size_t i = 0; i < OfGeometry::count; ++i) grad.push_back(wanted[i] ? found[i] : at::Tensor());
    grad.resize(grad.size() + 3);  // of the smoothing's names, what is wanted, and the size
    return grad;
  }
};

/// A compiled graph, which has its own derivatives, comes here again with what its tracing found wanted.
std::vector<at::Tensor> attributes_with_derivatives(const at::Tensor& frame, Words names,
                                                    at::TensorList inputs, Words smoothing_names,
                                                    c10::List<bool> wanted, std::int64_t views,
                                                    std::int64_t height, std::int64_t width) {
  return PackageAttributes::apply(frame, names, inputs, smoothing_names, wanted,
                                  std::array{views, height, width});
}

}  // namespace

TORCH_LIBRARY_FRAGMENT(dpr, m) {
  // inputs: vertices, views, intrinsics, smoothing's numbers, texcoords.
  m.def(
      "_attributes(Tensor frame, str[] names, Tensor[] inputs, str[] smoothing_names, bool[] wanted, "
      "int views, int height, int width) -> Tensor[]");
  m.def(
      "_attribute_gradients(Tensor frame, str[] names, Tensor[] grad_images, Tensor[] images, "
      "Tensor[] inputs, str[] smoothing_names, bool[] wanted) -> Tensor[]");
}

TORCH_LIBRARY_IMPL(dpr, CPU, m) {
  m.impl("_attributes", &render_attributes);
  m.impl("_attribute_gradients", &attribute_gradients);
}

TORCH_LIBRARY_IMPL(dpr, Autograd, m) { m.impl("_attributes", &attributes_with_derivatives); }

}  // namespace dpr::torch_op
