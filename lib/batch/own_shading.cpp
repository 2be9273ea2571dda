// Shading of the caller's own around a batch: samples out, values in, images out, and the gradients of both.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <string>
#include <vector>

#include "base/checks.hpp"
#include "base/parallel.hpp"
#include "batch/batch.hpp"
#include "batch/inputs.hpp"
#include "c/handles.hpp"
#include "dpr/error.hpp"

namespace dpr::batch {
namespace {

constexpr int k_corners = 3;

void require_one_of(const NamedArray& array, std::initializer_list<std::string_view> names,
                    const char* expected) {
  if (std::ranges::find(names, array.name) == names.end())
    throw InvalidArgument("samples (batch)", "'" + array.name + "'", expected);
}

void require_directions(std::size_t directions) {
  constexpr std::size_t k_most = 1U << 16U;  // so that numbers of their arrays can be counted
  if (directions == 0 || directions > k_most)
    throw InvalidArgument("directions", std::to_string(directions), "1 to " + std::to_string(k_most));
}

}  // namespace

dpr_raster Batch::raster() {
  Renderer::Impl& m = impl_of(frame_.renderer());
  m.require_samples("own shading");
  return {static_cast<int>(m.frame.width), static_cast<int>(m.frame.height), m.raster.supersampling,
          m.raster.margin, static_cast<int>(m.layers)};
}

void Batch::require_values(const NamedArray& array, bool is_by_sample, const NamedArray* like,
                           std::size_t directions) {
  const Renderer& renderer = frame_.renderer();
  const dpr_raster samples = raster();
  const Scene& scene = renderer.scene();
  const auto height = static_cast<std::size_t>(is_by_sample ? samples.height : scene.height),
             width = static_cast<std::size_t>(is_by_sample ? samples.width : scene.width);
  const std::size_t views = directions * renderer.views().size(),
                    channels = like ? like->shape.back() : k_any;
  const std::string expected = "[" + std::to_string(views) + ", " + std::to_string(height) + ", " +
                               std::to_string(width) + ", " + (like ? std::to_string(channels) : "C") + "]";
  require_floats(array, {views, height, width, channels}, expected);
  if (array.count() == 0) throw InvalidArgument(argument(array), text_of(array.shape), expected);
}

void Batch::require_samples(const NamedArray& array, std::size_t directions) {
  const dpr_raster size = raster();
  const std::size_t rows =
      directions * static_cast<std::size_t>(size.layers) * frame_.renderer().views().size();
  const auto height = static_cast<std::size_t>(size.height), width = static_cast<std::size_t>(size.width);
  const std::string form =
      "[" + std::to_string(rows) + ", " + std::to_string(height) + ", " + std::to_string(width);
  if (array.name == "face_id") require_form(array, Element::int64, {{rows, height, width}}, form + "]");
  if (array.name == "barycentrics") require_floats(array, {rows, height, width, k_corners}, form + ", 3]");
  if (array.name == "barycentric_steps") require_floats(array, {rows, height, width, 4}, form + ", 4]");
  if (array.name == "depth") require_floats(array, {rows, height, width}, form + "]");
}

void Batch::read_samples(NamedArrays samples) {
  for (const NamedArray& array : samples) {
    require_one_of(array, {"face_id", "barycentrics", "depth", "barycentric_steps"},
                   "face_id, barycentrics, depth or barycentric_steps");
    require_samples(array, 1);
  }
  Renderer::Impl& m = impl_of(frame_.renderer());
  m.require_samples("own shading");
  m.find_samples();
  if (const NamedArray* const steps = find(samples, "barycentric_steps")) {
    m.surface_samples->find_steps(m.frame, m.setup.triangles, m.clip.faces);
    m.surface_samples->steps.download(steps->rows<cl_float4>());
  }
  const MappedRead faces(m.surface_samples->faces);
  const MappedRead places(m.surface_samples->places);
  const auto fill = [&]<class Value>(const NamedArray& array, Value&& value) {
    const std::span out(static_cast<std::decay_t<decltype(value(0))>*>(array.data), faces.size());
    for_each_in_parallel(out.size(), [&](std::size_t i) { out[i] = value(i); });
  };
  for (const NamedArray& array : samples) {
    if (array.name == "face_id")
      fill(array, [&](std::size_t i) { return faces[i] == DPR_NO_FACE ? -1 : std::int64_t{faces[i]}; });
    if (array.name == "depth") fill(array, [&](std::size_t i) { return places[i].s[2]; });
    if (array.name != "barycentrics") continue;
    fill(array, [&](std::size_t i) {
      const float first = places[i].s[0], second = places[i].s[1];
      return faces[i] == DPR_NO_FACE ? glm::vec3(0.0F) : glm::vec3(1 - first - second, first, second);
    });
  }
}

void Batch::samples_tangent(std::size_t directions, NamedArrays tangents, NamedArrays samples) {
  require_directions(directions);
  for (const NamedArray& array : samples) {
    require_one_of(array, {"barycentrics", "depth"}, "barycentrics or depth: the others have no tangents");
    require_samples(array, directions);
  }
  const SamplesTangent found = frame_.renderer().samples_tangent(moving(directions, tangents));
  for (const NamedArray& array : samples) {
    if (array.name == "depth") {
      std::ranges::copy(found.depths, array.rows<float>().begin());
    } else {
      std::ranges::transform(found.barycentrics, array.rows<glm::vec3>().begin(),
                             [](const glm::vec2& b) { return glm::vec3(-b.x - b.y, b.x, b.y); });
    }
  }
}

void Batch::samples_backward(NamedArrays grads, NamedArrays gradients) {
  Renderer& renderer = frame_.renderer();
  start_gradients(gradients);
  const dpr_raster size = raster();
  const std::size_t count = static_cast<std::size_t>(size.layers) * renderer.views().size() *
                            static_cast<std::size_t>(size.height) * static_cast<std::size_t>(size.width);
  std::span<const float> depths;
  std::span<const glm::vec3> barycentrics;
  for (const NamedArray& grad : grads) {
    require_one_of(grad, {"barycentrics", "depth"}, "barycentrics or depth: the others have no gradients");
    const std::size_t numbers = grad.name == "depth" ? count : k_corners * count;
    if (grad.element != Element::float32 || grad.count() != numbers)
      throw InvalidArgument(argument(grad), text_of(grad.shape), std::to_string(numbers) + " floats");
    if (grad.name == "depth") {
      depths = grad.rows<const float>();
      checks::require_numbers(depths, count, "grad_depths");
    } else {
      barycentrics = grad.rows<const glm::vec3>();
    }
  }
  renderer.set_gradients(request_of(wanted_, true));
  SceneGradient found = impl_of(renderer).samples_backward([&](std::span<cl_float4> places) {
    std::atomic<float> wrong = 0;  // of the differences, which finite numbers may not have
    for_each_in_parallel(count, [&](std::size_t i) {
      const glm::vec3 g = barycentrics.empty() ? glm::vec3(0) : barycentrics[i];
      const float first = g.y - g.x, second = g.z - g.x;
      for (const float number : {first, second})
        if (!std::isfinite(number)) wrong = number;
      places[i] = {{first, second, depths.empty() ? 0 : depths[i], 0}};
    });
    if (wrong != 0) throw InvalidArgument("grad_barycentrics", checks::text(wrong.load()), "finite numbers");
  });
  add_gradients(found, true, gradients);
}

const Batch::Covered& Batch::covered() {
  if (covered_) return *covered_;
  Renderer::Impl& m = impl_of(frame_.renderer());
  m.require_samples("own shading");
  m.find_samples();
  const MappedRead faces(m.surface_samples->faces);
  const MappedRead places(m.surface_samples->places);
  const std::size_t count = faces.size() / m.layers,
                    parts = std::max<std::size_t>(count / k_least_of_thread, 1);
  std::vector<Covered> of_parts(parts);
  const auto find_part = [&](std::size_t part) {
    Covered& found = of_parts[part];
    for (std::size_t i = count * part / parts; i < count * (part + 1) / parts; ++i) {
      if (faces[i] == DPR_NO_FACE) continue;
      found.numbers.push_back(to_uint(i));
      found.faces.push_back(static_cast<std::int32_t>(faces[i]));
      found.places.emplace_back(places[i].s[0], places[i].s[1]);
    }
  };
  for_each_in_parallel(parts, find_part, 1);
  covered_.emplace(std::move(of_parts[0]));
  for (const Covered& part : std::span(of_parts).subspan(1)) {
    covered_->numbers.insert(covered_->numbers.end(), part.numbers.begin(), part.numbers.end());
    covered_->faces.insert(covered_->faces.end(), part.faces.begin(), part.faces.end());
    covered_->places.insert(covered_->places.end(), part.places.begin(), part.places.end());
  }
  return *covered_;
}

SampleArrays Batch::covered_samples() {
  const dpr_raster size = raster();
  const auto width = static_cast<std::size_t>(size.width), height = static_cast<std::size_t>(size.height);
  const Covered& found = covered();
  return {{width, height, 1, frame_.renderer().views().size() * width * height},
          found.numbers,
          found.faces.data(),
          found.places.data()};
}

void Batch::require_covered(const NamedArray& array, std::size_t channels) {
  const std::size_t count = covered_count();
  const std::string expected = "[" + std::to_string(count) + ", " +
                               (channels == k_any ? "C" : std::to_string(channels)) +
                               "], samples with a face";
  require_floats(array, {count, channels}, expected);
  if (array.shape[0] != count || array.shape[1] == 0)
    throw InvalidArgument(argument(array), text_of(array.shape), expected);
}

Attributes Batch::attributes_of(NamedArrays arrays, std::vector<glm::uvec3>& faces) {
  for (const NamedArray& array : arrays)
    require_one_of(array, {"attributes", "faces"}, "attributes or faces");
  const NamedArray& attributes = require(arrays, "attributes");
  require_form(attributes, Element::float32, {{k_any, k_any}, {k_any, k_any, k_any}}, "[V, C] or [N, V, C]");
  const std::size_t views = frame_.renderer().views().size();
  const auto is_of_views = [&](const NamedArray& array) {
    if (array.shape.size() == 3 && array.shape[0] != views)
      throw InvalidArgument(argument(array), text_of(array.shape), std::to_string(views) + " of them");
    return array.shape.size() == 3;
  };
  Attributes of{{}, attributes.rows<const float>(), attributes.shape.back(), is_of_views(attributes), false};
  const Renderer& renderer = frame_.renderer();
  if (const NamedArray* const given = find(arrays, "faces")) {
    of.faces_are_of_views = is_of_views(*given);
    faces = read_triples(*given, of.faces_are_of_views ? views : 1);
    of.faces = faces;
  } else {
    of.faces = renderer.scene().meshes[0].mesh.faces;
    of.faces_are_of_views = impl_of(renderer).geometry->has_own_faces();
  }
  return of;
}

void Batch::interpolate(NamedArrays arrays, const NamedArray& values) {
  std::vector<glm::uvec3> faces;
  const Attributes attributes = attributes_of(arrays, faces);
  require_covered(values, attributes.channels);
  dpr::interpolate(covered_samples(), attributes, values.rows<float>());
}

void Batch::interpolate_backward(NamedArrays arrays, const NamedArray& grad_values,
                                 const NamedArray& grad_attributes, NamedArrays gradients) {
  Renderer& renderer = frame_.renderer();
  start_gradients(gradients);
  std::vector<glm::uvec3> faces;
  const Attributes attributes = attributes_of(arrays, faces);
  require_covered(grad_values, attributes.channels);
  require_like(grad_attributes, require(arrays, "attributes"));
  const InterpolateGradient by =
      dpr::interpolate_backward(covered_samples(), attributes, grad_values.rows<const float>(), {});
  std::ranges::copy(by.values, grad_attributes.rows<float>().begin());
  if (gradients.empty()) return;
  const std::vector<cl_uint>& numbers = covered().numbers;
  renderer.set_gradients(request_of(wanted_, true));
  SceneGradient found = impl_of(renderer).samples_backward([&](std::span<cl_float4> places) {
    for_each_in_parallel(places.size(), [&](std::size_t i) { places[i] = {}; });
    for_each_in_parallel(numbers.size(), [&](std::size_t i) {
      places[numbers[i]] = {{by.barycentrics[i].x, by.barycentrics[i].y, 0, 0}};
    });
  });
  add_gradients(found, true, gradients);
}

SampleValues Batch::values_of(const NamedArray& array) {
  if (array.shape.size() == 2) {
    require_covered(array, k_any);
    checks::require_numbers(array.rows<const float>(), array.count(), "samples (resolve)");
    return {array.rows<const float>(), array.shape.back(), &covered().numbers};
  }
  require_values(array, true, nullptr);
  impl_of(frame_.renderer()).require_values(array.rows<const float>(), array.shape.back());
  return {array.rows<const float>(), array.shape.back()};
}

void Batch::resolve(const NamedArray& values, const NamedArray& images) {
  const SampleValues given = values_of(values);
  require_values(images, false, &values);
  impl_of(frame_.renderer()).resolve(given, images.rows<float>());
}

void Batch::resolve_backward(const NamedArray* values, const NamedArray& grad_images,
                             const NamedArray& grad_values, NamedArrays gradients) {
  Renderer& renderer = frame_.renderer();
  start_gradients(gradients);
  const bool is_covered = grad_values.shape.size() == 2;
  is_covered ? require_covered(grad_values, k_any) : require_values(grad_values, true, nullptr);
  require_values(grad_images, false, &grad_values);
  if (values) {
    require_like(grad_values, *values);
  } else if (!impl_of(renderer).holds_resolved()) {
    throw InvalidArgument("values (batch)", "NULL",
                          "values, unless dpr_frame_resolve() took them last, of at most 4 channels");
  }
  const SampleValues given =
      values ? values_of(*values)
             : SampleValues{{}, grad_values.shape.back(), is_covered ? &covered().numbers : nullptr, true};
  if (find(gradients, "sigma"))
    throw InvalidArgument("sigma (batch)", "its gradient",
                          "that of vertices, views or intrinsics, with own shading");
  renderer.set_gradients(request_of(wanted_, true));
  const auto grads = grad_images.rows<const float>();
  checks::require_numbers(grads, grads.size(), "grad_pixels (resolve)");
  SceneGradient found = impl_of(renderer).resolve_backward(given, grads, grad_values.rows<float>());
  add_gradients(found, true, gradients);
}

void Batch::resolve_tangent(std::size_t directions, NamedArrays tangents, const NamedArray& values,
                            const NamedArray& value_tangents, const NamedArray& images) {
  require_directions(directions);
  require_values(values, true, nullptr);
  require_values(value_tangents, true, &values, directions);
  require_values(images, false, &values, directions);
  const std::vector<float> pixels =
      frame_.renderer().resolve_tangent(values.rows<const float>(), values.shape.back(),
                                        value_tangents.rows<const float>(), moving(directions, tangents));
  std::ranges::copy(pixels, images.rows<float>().begin());
}

}  // namespace dpr::batch

using namespace dpr::c;

dpr_status dpr_frame_raster(dpr_frame* frame, dpr_raster* raster) {
  return guarded([&] { deref(raster, "raster") = deref(frame, "frame").batch->raster(); });
}

dpr_status dpr_frame_samples(dpr_frame* frame, const dpr_array* samples, std::size_t count) {
  return guarded(
      [&] { deref(frame, "frame").batch->read_samples(dpr::batch::to_arrays(samples, count, "samples")); });
}

dpr_status dpr_frame_samples_backward(dpr_frame* frame, const dpr_array* grads, std::size_t grad_count,
                                      const dpr_array* gradients, std::size_t gradient_count) {
  return guarded([&] {
    deref(frame, "frame")
        .batch->samples_backward(dpr::batch::to_arrays(grads, grad_count, "grads"),
                                 dpr::batch::to_arrays(gradients, gradient_count, "gradients"));
  });
}

dpr_status dpr_frame_covered(dpr_frame* frame, std::size_t* count) {
  return guarded([&] { deref(count, "count") = deref(frame, "frame").batch->covered_count(); });
}

dpr_status dpr_frame_interpolate(dpr_frame* frame, const dpr_array* arrays, std::size_t count,
                                 const dpr_array* values) {
  return guarded([&] {
    deref(frame, "frame")
        .batch->interpolate(dpr::batch::to_arrays(arrays, count, "arrays"),
                            dpr::batch::to_arrays(values, 1, "values")[0]);
  });
}

dpr_status dpr_frame_interpolate_backward(dpr_frame* frame, const dpr_array* arrays, std::size_t count,
                                          const dpr_array* grad_values, const dpr_array* grad_attributes,
                                          const dpr_array* gradients, std::size_t gradient_count) {
  return guarded([&] {
    deref(frame, "frame")
        .batch->interpolate_backward(dpr::batch::to_arrays(arrays, count, "arrays"),
                                     dpr::batch::to_arrays(grad_values, 1, "grad_values")[0],
                                     dpr::batch::to_arrays(grad_attributes, 1, "grad_attributes")[0],
                                     dpr::batch::to_arrays(gradients, gradient_count, "gradients"));
  });
}

dpr_status dpr_frame_resolve(dpr_frame* frame, const dpr_array* values, const dpr_array* images) {
  return guarded([&] {
    deref(frame, "frame")
        .batch->resolve(dpr::batch::to_arrays(values, 1, "values")[0],
                        dpr::batch::to_arrays(images, 1, "images")[0]);
  });
}

dpr_status dpr_frame_resolve_backward(dpr_frame* frame, const dpr_array* values, const dpr_array* grad_images,
                                      const dpr_array* grad_values, const dpr_array* gradients,
                                      std::size_t gradient_count) {
  return guarded([&] {
    deref(frame, "frame")
        .batch->resolve_backward(values ? &dpr::batch::to_arrays(values, 1, "values")[0] : nullptr,
                                 dpr::batch::to_arrays(grad_images, 1, "grad_images")[0],
                                 dpr::batch::to_arrays(grad_values, 1, "grad_values")[0],
                                 dpr::batch::to_arrays(gradients, gradient_count, "gradients"));
  });
}

dpr_status dpr_frame_samples_tangent(dpr_frame* frame, std::size_t directions, const dpr_array* tangents,
                                     std::size_t tangent_count, const dpr_array* samples,
                                     std::size_t sample_count) {
  return guarded([&] {
    deref(frame, "frame")
        .batch->samples_tangent(directions, dpr::batch::to_arrays(tangents, tangent_count, "tangents"),
                                dpr::batch::to_arrays(samples, sample_count, "samples"));
  });
}

dpr_status dpr_frame_resolve_tangent(dpr_frame* frame, std::size_t directions, const dpr_array* tangents,
                                     std::size_t tangent_count, const dpr_array* values,
                                     const dpr_array* value_tangents, const dpr_array* images) {
  return guarded([&] {
    deref(frame, "frame")
        .batch->resolve_tangent(directions, dpr::batch::to_arrays(tangents, tangent_count, "tangents"),
                                dpr::batch::to_arrays(values, 1, "values")[0],
                                dpr::batch::to_arrays(value_tangents, 1, "value_tangents")[0],
                                dpr::batch::to_arrays(images, 1, "images")[0]);
  });
}
