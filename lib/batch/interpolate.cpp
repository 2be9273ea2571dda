// Numbers of vertices at samples, from named arrays, in the C interface.
#include "renderer/interpolate.hpp"

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "batch/inputs.hpp"
#include "c/handles.hpp"
#include "dpr/error.hpp"

namespace dpr::batch {
namespace {

/// Samples and attributes that arrays hold.
class InterpolateCall {
 public:
  explicit InterpolateCall(NamedArrays arrays)
      : face_id_(require(arrays, "face_id")),
        barycentrics_(require(arrays, "barycentrics")),
        attributes_(require(arrays, "attributes")) {
    for (const NamedArray& array : arrays)
      if (array.name != "face_id" && array.name != "barycentrics" && array.name != "barycentric_steps" &&
          array.name != "attributes" && array.name != "faces")
        throw InvalidArgument("name (interpolate)", "'" + array.name + "'",
                              "face_id, barycentrics, barycentric_steps, attributes or faces");
    require_form(face_id_, Element::int64, {{k_any, k_any, k_any}}, "[N, h, w]");
    require_at_samples(barycentrics_, 3, "[N, h, w, 3], as face_id");
    require_form(attributes_, Element::float32, {{k_any, k_any}, {k_any, k_any, k_any}},
                 "[V, C] or [N, V, C]");
    const NamedArray& faces = require(arrays, "faces");
    const auto views_of = [](const NamedArray& array) {
      return array.shape.size() == 3 ? array.shape[0] : 1;
    };
    const std::size_t views = std::max(views_of(attributes_), views_of(faces)), rows = face_id_.shape[0];
    faces_ = read_triples(faces, views_of(faces));
    samples_.width = static_cast<int>(face_id_.shape[2]);
    samples_.height = static_cast<int>(face_id_.shape[1]);
    samples_.layers = views > 1 ? static_cast<int>(rows / views) : 1;
    if (views == 0 || (views > 1 && rows % views != 0))
      throw InvalidArgument(
          argument(face_id_), text_of(face_id_.shape),
          "layers of the " + std::to_string(views) + " views that attributes or faces have");
    for (const NamedArray* const array : {&attributes_, &faces})
      if (array->shape.size() == 3 && array->shape[0] != views)
        throw InvalidArgument(argument(*array), text_of(array->shape), std::to_string(views) + " of them");
    read_samples(find(arrays, "barycentric_steps"));
    of_ = {faces_, attributes_.rows<const float>(), attributes_.shape.back(), attributes_.shape.size() == 3,
           faces.shape.size() == 3};
  }

  const Samples& samples() const { return samples_; }
  const Attributes& attributes() const { return of_; }

  /// Throws unless it holds numbers at the samples, `of_channel` for each channel.
  void require_values(const NamedArray& array, std::size_t of_channel) const {
    require_at_samples(array, of_channel * of_.channels,
                       of_channel == 1 ? "[N, h, w, C], as face_id and attributes" : "[N, h, w, 2 C]");
  }
  void require_attributes(const NamedArray& array) const { require_like(array, attributes_); }
  void require_barycentrics(const NamedArray& array) const { require_like(array, barycentrics_); }

 private:
  void require_at_samples(const NamedArray& array, std::size_t channels, const std::string& expected) const {
    const std::vector<std::size_t>& size = face_id_.shape;
    require_floats(array, {size[0], size[1], size[2], channels}, expected);
  }

  void read_samples(const NamedArray* steps) {
    const std::span ids(static_cast<const std::int64_t*>(face_id_.data), face_id_.count());
    const auto wrong = std::ranges::find_if(
        ids, [](std::int64_t face) { return face < -1 || face > std::numeric_limits<std::int32_t>::max(); });
    if (wrong != ids.end()) throw InvalidArgument(argument(face_id_), std::to_string(*wrong), "faces, or -1");
    samples_.faces.assign(ids.begin(), ids.end());
    samples_.barycentrics.reserve(ids.size());
    for (const glm::vec3& b : barycentrics_.rows<const glm::vec3>())
      samples_.barycentrics.emplace_back(b.y, b.z);
    if (!steps) return;
    require_at_samples(*steps, 4, "[N, h, w, 4], as face_id");
    const auto rows = steps->rows<const glm::vec4>();
    samples_.steps.assign(rows.begin(), rows.end());
  }

  const NamedArray &face_id_, &barycentrics_, &attributes_;
  std::vector<glm::uvec3> faces_;
  Samples samples_;
  Attributes of_;
};

[[noreturn]] void refuse(const NamedArray& array, const char* expected) {
  throw InvalidArgument("name (interpolate)", "'" + array.name + "'", expected);
}

void copy_to(const NamedArray& array, std::span<const float> numbers) {
  std::ranges::copy(numbers, array.rows<float>().begin());
}

void interpolate_to(NamedArrays arrays, NamedArrays outputs) {
  const InterpolateCall call(arrays);
  for (const NamedArray& output : outputs) {
    const bool are_steps = output.name == "steps";
    if (!are_steps && output.name != "values") refuse(output, "values or steps");
    call.require_values(output, are_steps ? 2 : 1);
    if (are_steps) require(arrays, "barycentric_steps");
  }
  for (const NamedArray& output : outputs) {
    if (output.name == "steps") {
      copy_to(output, interpolate_steps(call.samples(), call.attributes()));
    } else {
      interpolate(call.samples(), call.attributes(), output.rows<float>());
    }
  }
}

void backward(NamedArrays arrays, NamedArrays grads, NamedArrays gradients) {
  const InterpolateCall call(arrays);
  std::span<const float> grad_values, grad_steps;
  for (const NamedArray& grad : grads) {
    const bool are_steps = grad.name == "steps";
    if (!are_steps && grad.name != "values") refuse(grad, "values or steps");
    call.require_values(grad, are_steps ? 2 : 1);
    if (are_steps) require(arrays, "barycentric_steps");
    (are_steps ? grad_steps : grad_values) = grad.rows<const float>();
  }
  std::vector<float> none;
  if (grad_values.empty()) {
    none.resize(call.samples().faces.size() * call.attributes().channels);
    grad_values = none;
  }
  for (const NamedArray& gradient : gradients) {
    if (gradient.name == "attributes") {
      call.require_attributes(gradient);
    } else if (gradient.name == "barycentrics") {
      call.require_barycentrics(gradient);
    } else {
      refuse(gradient, "attributes or barycentrics");
    }
  }
  const InterpolateGradient found =
      interpolate_backward(call.samples(), call.attributes(), grad_values, grad_steps);
  for (const NamedArray& gradient : gradients) {
    if (gradient.name == "attributes") {
      copy_to(gradient, found.values);
    } else {
      std::ranges::transform(found.barycentrics, gradient.rows<glm::vec3>().begin(),
                             [](const glm::vec2& b) { return glm::vec3(0, b); });
    }
  }
}

void tangent(NamedArrays arrays, NamedArrays tangents, const NamedArray& values) {
  const InterpolateCall call(arrays);
  call.require_values(values, 1);
  std::span<const float> attributes;
  std::vector<vec2> barycentrics;
  for (const NamedArray& moving : tangents) {
    if (moving.name == "attributes") {
      call.require_attributes(moving);
      attributes = moving.rows<const float>();
    } else if (moving.name == "barycentrics") {
      call.require_barycentrics(moving);
      for (const glm::vec3& b : moving.rows<const glm::vec3>()) barycentrics.emplace_back(b.y, b.z);
    } else {
      refuse(moving, "attributes or barycentrics");
    }
  }
  copy_to(values, interpolate_tangent(call.samples(), call.attributes(), attributes, barycentrics));
}

}  // namespace
}  // namespace dpr::batch

using namespace dpr::c;
using dpr::batch::to_arrays;

dpr_status dpr_interpolate(const dpr_array* arrays, std::size_t count, const dpr_array* outputs,
                           std::size_t output_count) {
  return guarded([&] {
    dpr::batch::interpolate_to(to_arrays(arrays, count, "arrays"),
                               to_arrays(outputs, output_count, "outputs"));
  });
}

dpr_status dpr_interpolate_backward(const dpr_array* arrays, std::size_t count, const dpr_array* grads,
                                    std::size_t grad_count, const dpr_array* gradients,
                                    std::size_t gradient_count) {
  return guarded([&] {
    dpr::batch::backward(to_arrays(arrays, count, "arrays"), to_arrays(grads, grad_count, "grads"),
                         to_arrays(gradients, gradient_count, "gradients"));
  });
}

dpr_status dpr_interpolate_tangent(const dpr_array* arrays, std::size_t count, const dpr_array* tangents,
                                   std::size_t tangent_count, const dpr_array* values) {
  return guarded([&] {
    dpr::batch::tangent(to_arrays(arrays, count, "arrays"), to_arrays(tangents, tangent_count, "tangents"),
                        to_arrays(values, 1, "values")[0]);
  });
}
