// Numbers of vertices at samples, from named arrays, in the C interface.
#include "renderer/interpolate.hpp"

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "base/parallel.hpp"
#include "batch/inputs.hpp"
#include "c/handles.hpp"
#include "dpr/error.hpp"

namespace dpr::batch {
namespace {

/// Samples and attributes that arrays hold.
class InterpolateCall {
 public:
  explicit InterpolateCall(NamedArrays arrays)
      : is_rast_(find(arrays, "rast") != nullptr),
        face_id_(require(arrays, is_rast_ ? "rast" : "face_id")),
        barycentrics_(require(arrays, is_rast_ ? "rast" : "barycentrics")),
        steps_(find(arrays, is_rast_ ? "rast_db" : "barycentric_steps")),
        attributes_(require(arrays, "attributes")) {
    for (const NamedArray& array : arrays)
      if (array.name != face_id_.name && array.name != barycentrics_.name && &array != steps_ &&
          array.name != "attributes" && array.name != "faces")
        throw InvalidArgument("name (interpolate)", "'" + array.name + "'",
                              is_rast_ ? "rast, rast_db, attributes or faces"
                                       : "face_id, barycentrics, barycentric_steps, attributes or faces");
    if (is_rast_) {
      require_form(face_id_, Element::float32, {{k_any, k_any, k_any, 4}}, "[N, H, W, 4]");
    } else {
      require_form(face_id_, Element::int64, {{k_any, k_any, k_any}}, "[N, h, w]");
      require_at_samples(barycentrics_, 3, "[N, h, w, 3], as face_id");
    }
    if (steps_) require_at_samples(*steps_, 4, "[N, h, w, 4], as face_id");
    require_form(attributes_, Element::float32, {{k_any, k_any}, {k_any, k_any, k_any}},
                 "[V, C] or [N, V, C]");
    const NamedArray& faces = require(arrays, "faces");
    const auto views_of = [](const NamedArray& array) {
      return array.shape.size() == 3 ? array.shape[0] : 1;
    };
    const std::size_t views = std::max(views_of(attributes_), views_of(faces)), rows = face_id_.shape[0];
    faces_ = read_triples(faces, views_of(faces));
    if (views == 0 || (views > 1 && rows % views != 0))
      throw InvalidArgument(
          argument(face_id_), text_of(face_id_.shape),
          "layers of the " + std::to_string(views) + " views that attributes or faces have");
    for (const NamedArray* const array : {&attributes_, &faces})
      if (array->shape.size() == 3 && array->shape[0] != views)
        throw InvalidArgument(argument(*array), text_of(array->shape), std::to_string(views) + " of them");
    const SampleArrays::Size size{face_id_.shape[2], face_id_.shape[1], views > 1 ? rows / views : 1,
                                  rows * face_id_.shape[1] * face_id_.shape[2]};
    const glm::vec4* const steps = steps_ ? static_cast<const glm::vec4*>(steps_->data) : nullptr;
    if (is_rast_) {
      samples_.emplace(size, static_cast<const glm::vec4*>(face_id_.data), steps);
    } else {
      samples_.emplace(size, static_cast<const std::int64_t*>(face_id_.data),
                       static_cast<const glm::vec3*>(barycentrics_.data), steps);
    }
    of_ = {faces_, attributes_.rows<const float>(), attributes_.shape.back(), attributes_.shape.size() == 3,
           faces.shape.size() == 3};
  }

  const SampleArrays& samples() const { return *samples_; }
  const Attributes& attributes() const { return of_; }

  /// Throws unless it holds each channel at the samples, or its steps, which there are.
  void require_values(const NamedArray& array, bool are_steps) const {
    require_at_samples(array, (are_steps ? 2 : 1) * of_.channels,
                       are_steps ? "[N, h, w, 2 C]" : "[N, h, w, C], as face_id and attributes");
    if (are_steps && !steps_)
      throw InvalidArgument("arrays (interpolate)", "none for steps",
                            is_rast_ ? "rast_db" : "barycentric_steps");
  }
  /// Of arrays of gradients and tangents: of the attributes, of the places, or of the steps. Throws for others.
  bool are_attributes(const NamedArray& array) const { return is_like(array, &attributes_); }
  bool are_places(const NamedArray& array) const { return is_like(array, &barycentrics_); }
  bool are_steps(const NamedArray& array) const { return is_like(array, steps_); }

  /// From gradients by the barycentrics of corners 1 and 2, and by their steps, to those of the arrays.
  void give_places(std::span<const vec2> found, const NamedArray& to) const {
    if (is_rast_) {  // u, v are those of corners 0 and 1
      give(found, to.rows<glm::vec4>(), [](const vec2& g) { return glm::vec4(-g.y, g.x - g.y, 0, 0); });
    } else {
      give(found, to.rows<glm::vec3>(), [](const vec2& g) { return glm::vec3(0, g); });
    }
  }
  void give_steps(std::span<const vec4> found, const NamedArray& to) const {
    give(found, to.rows<glm::vec4>(),
         [this](const vec4& g) { return is_rast_ ? glm::vec4(-g.z, -g.w, g.x - g.z, g.y - g.w) : g; });
  }

 private:
  void require_at_samples(const NamedArray& array, std::size_t channels, const std::string& expected) const {
    const std::vector<std::size_t>& size = face_id_.shape;
    require_floats(array, {size[0], size[1], size[2], channels}, expected);
  }

  static bool is_like(const NamedArray& array, const NamedArray* other) {
    if (!other || array.name != other->name) return false;
    require_like(array, *other);
    return true;
  }

  template <class From, class To, class Convert>
  static void give(std::span<const From> from, std::span<To> to, const Convert& convert) {
    for_each_in_parallel(from.size(), [&](std::size_t i) { to[i] = convert(from[i]); });
  }

  bool is_rast_;  // samples are as nvdiffrast has them
  const NamedArray &face_id_, &barycentrics_;
  const NamedArray* steps_;
  const NamedArray& attributes_;
  std::vector<glm::uvec3> faces_;
  std::optional<SampleArrays> samples_;
  Attributes of_;
};

[[noreturn]] void refuse(const NamedArray& array, const char* expected) {
  throw InvalidArgument("name (interpolate)", "'" + array.name + "'", expected);
}

void interpolate_to(NamedArrays arrays, NamedArrays outputs) {
  const InterpolateCall call(arrays);
  for (const NamedArray& output : outputs) {
    const bool are_steps = output.name == "steps";
    if (!are_steps && output.name != "values") refuse(output, "values or steps");
    call.require_values(output, are_steps);
  }
  for (const NamedArray& output : outputs) {
    if (output.name == "steps") {
      interpolate_steps(call.samples(), call.attributes(), output.rows<float>());
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
    call.require_values(grad, are_steps);
    (are_steps ? grad_steps : grad_values) = grad.rows<const float>();
  }
  std::vector<float> none;
  if (grad_values.empty()) {
    none.resize(call.samples().size().count * call.attributes().channels);
    grad_values = none;
  }
  for (const NamedArray& gradient : gradients)
    if (!call.are_attributes(gradient) && !call.are_places(gradient) && !call.are_steps(gradient))
      refuse(gradient, "attributes, or samples that were given");
  InterpolateGradient found =
      interpolate_backward(call.samples(), call.attributes(), grad_values, grad_steps);
  found.steps.resize(call.samples().has_steps() ? call.samples().size().count : 0);
  for (const NamedArray& gradient : gradients) {
    if (call.are_attributes(gradient)) {
      std::ranges::copy(found.values, gradient.rows<float>().begin());
    } else if (call.are_places(gradient)) {
      call.give_places(found.barycentrics, gradient);
    } else {
      call.give_steps(found.steps, gradient);
    }
  }
}

void tangent(NamedArrays arrays, NamedArrays tangents, const NamedArray& values) {
  const InterpolateCall call(arrays);
  call.require_values(values, false);
  std::span<const float> attributes;
  std::vector<vec2> barycentrics;
  for (const NamedArray& moving : tangents) {
    if (call.are_attributes(moving)) {
      attributes = moving.rows<const float>();
    } else if (call.are_places(moving) && moving.name == "barycentrics") {
      for (const glm::vec3& b : moving.rows<const glm::vec3>()) barycentrics.emplace_back(b.y, b.z);
    } else {
      refuse(moving, "attributes or barycentrics");
    }
  }
  std::ranges::copy(interpolate_tangent(call.samples(), call.attributes(), attributes, barycentrics),
                    values.rows<float>().begin());
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
