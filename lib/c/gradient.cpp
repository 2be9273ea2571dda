// Gradients of the C interface.
#include <algorithm>

#include "c/handles.hpp"
#include "dpr/opencl_handles.hpp"
#include "scene/gradient_table.hpp"

using dpr::InvalidArgument;
using namespace dpr::c;

namespace dpr::c {

std::vector<dpr_gradient::Array> arrays_of(const Renderer& renderer, SceneGradient gradient) {
  std::vector<dpr_gradient::Array> arrays;
  for_each_array(gradient, [&](const GradientRow& row, GradientIndex index, const GradientArray& array) {
    if (!(renderer.scene().gradients.*row.wanted) || !exists(row, index, renderer.scene(), renderer.views()))
      return;
    dpr_gradient::Array copy{name_of(row, index), {}};
    transform_numbers(array, [&](double number) {
      copy.values.push_back(number);
      return number;
    });
    if (!copy.values.empty()) arrays.push_back(std::move(copy));
  });
  return arrays;
}

namespace {

void give_gradient(dpr_gradient** out, const Renderer& renderer, SceneGradient gradient) {
  give(out, arrays_of(renderer, std::move(gradient)));
}

const dpr_gradient::Array& array_named(const dpr_gradient* gradient, const char* name) {
  const std::string_view wanted = &deref(name, "name");
  const auto& arrays = deref(gradient, "gradient").arrays;
  const auto found = std::ranges::find(arrays, wanted, &dpr_gradient::Array::name);
  if (found != arrays.end()) return *found;
  std::string known;
  for (const auto& array : arrays) known.append(known.empty() ? "" : ", ").append(array.name);
  throw InvalidArgument("name (gradient)", "\"" + std::string(wanted) + "\"", "one of " + known);
}

}  // namespace
}  // namespace dpr::c

dpr_status dpr_backward_loss(dpr_renderer* renderer, const dpr_loss* loss, dpr_gradient** gradient) {
  return guarded([&] {
    deref(gradient, "gradient");
    dpr::Renderer& r = renderer_of(renderer);
    give_gradient(gradient, r, r.backward(deref(loss, "loss").loss));
  });
}

dpr_status dpr_backward_losses(dpr_renderer* renderer, const dpr_loss* loss, const dpr_mesh_loss* mesh_loss,
                               dpr_gradient** gradient) {
  return guarded([&] {
    deref(gradient, "gradient");
    dpr::Renderer& r = renderer_of(renderer);
    give_gradient(gradient, r, r.backward(deref(loss, "loss").loss, deref(mesh_loss, "mesh_loss").loss));
  });
}

dpr_status dpr_backward_pixels(dpr_renderer* renderer, const float* grad, std::size_t count,
                               dpr_gradient** gradient) {
  return guarded([&] {
    deref(gradient, "gradient");
    dpr::Renderer& r = renderer_of(renderer);
    give_gradient(gradient, r, r.backward_pixels(to_pixels(grad, count, "grad")));
  });
}

dpr_status dpr_backward_buffer(dpr_renderer* renderer, struct _cl_mem* grad, dpr_gradient** gradient) {
  return guarded([&] {
    deref(gradient, "gradient");
    deref(grad, "grad");
    dpr::Renderer& r = renderer_of(renderer);
    give_gradient(gradient, r, dpr::backward(r, grad));
  });
}

dpr_status dpr_gradient_count(const dpr_gradient* gradient, std::size_t* count) {
  return guarded([&] { deref(count, "count") = deref(gradient, "gradient").arrays.size(); });
}

dpr_status dpr_gradient_name(const dpr_gradient* gradient, std::size_t index, const char** name) {
  return guarded([&] {
    const auto& arrays = deref(gradient, "gradient").arrays;
    if (index >= arrays.size())
      throw InvalidArgument("index", std::to_string(index), "below " + std::to_string(arrays.size()));
    deref(name, "name") = arrays[index].name.c_str();
  });
}

dpr_status dpr_gradient_size(const dpr_gradient* gradient, const char* name, std::size_t* count) {
  return guarded([&] { deref(count, "count") = array_named(gradient, name).values.size(); });
}

dpr_status dpr_gradient_read(const dpr_gradient* gradient, const char* name, double* values,
                             std::size_t count) {
  return guarded([&] {
    deref(values, "values");
    const std::vector<double>& found = array_named(gradient, name).values;
    if (count != found.size())
      throw InvalidArgument("count (values)", std::to_string(count), std::to_string(found.size()));
    std::ranges::copy(found, values);
  });
}

void dpr_gradient_destroy(dpr_gradient* gradient) { destroy(gradient); }
