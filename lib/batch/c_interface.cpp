// Frames of named arrays in the C interface.
#include <memory>

#include "base/checks.hpp"
#include "base/name_list.hpp"
#include "batch/batch.hpp"
#include "c/handles.hpp"

using dpr::InvalidArgument;
using namespace dpr::c;

struct dpr_frame {
  static constexpr const char* k_handle = "dpr_frame";
  std::unique_ptr<dpr::batch::Batch> batch;
};

struct dpr_cut {
  static constexpr const char* k_handle = "dpr_cut";
  dpr::batch::CutFaces faces;
};

namespace dpr::c {
namespace {

constexpr int k_most_dimensions = 4;
constexpr std::size_t k_most_words = 1U << 16U;

std::vector<std::string> to_words(const char* const* words, std::size_t count, const char* argument) {
  if (count > 0) deref(words, argument);
  if (count > k_most_words)
    throw InvalidArgument(argument, std::to_string(count), "at most " + std::to_string(k_most_words));
  std::vector<std::string> copies;
  for (const char* word : std::span(words, count)) copies.emplace_back(&deref(word, argument));
  return copies;
}

std::vector<batch::NamedArray> to_arrays(const dpr_array* arrays, std::size_t count, const char* argument) {
  if (count > 0) deref(arrays, argument);
  if (count > k_most_words)
    throw InvalidArgument(argument, std::to_string(count), "at most " + std::to_string(k_most_words));
  std::vector<batch::NamedArray> named;
  for (const dpr_array& array : std::span(arrays, count)) {
    const std::string name = &deref(array.name, "name (array)");
    if (array.element < DPR_FLOAT32 || array.element > DPR_INT64)
      throw InvalidArgument("element (" + name + ")", std::to_string(array.element), "a dpr_element");
    if (array.dimensions < 0 || array.dimensions > k_most_dimensions)
      throw InvalidArgument("dimensions (" + name + ")", std::to_string(array.dimensions), "0 to 4");
    named.push_back({name,
                     array.data,
                     static_cast<batch::Element>(array.element),
                     {array.shape, array.shape + array.dimensions}});
    if (named.back().count() > 0 && !array.data) throw InvalidArgument(name, "NULL", "a pointer");
  }
  return named;
}

batch::RenderSettings to_settings(const dpr_frame_options& options) {
  return batch::settings_from_texts(options.width, options.height,
                                    to_words(options.settings, options.setting_count, "settings"));
}

dpr_frame_options to_options(const dpr_frame_options* options) {
  return versioned<dpr_frame_options>(options, DPR_FRAME_OPTIONS_INIT, "options");
}

/// Vectors or numbers as an array's whole numbers, or as its floats.
template <typename Value, typename Element>
void copy_to(const batch::NamedArray& array, batch::Element element, const std::vector<Value>& values,
             const Element*) {
  constexpr std::size_t k_numbers = sizeof(Value) / sizeof(std::uint32_t);
  if constexpr (k_numbers == 1) {
    batch::require_form(array, element, {{values.size()}}, std::to_string(values.size()));
  } else {
    batch::require_form(array, element, {{values.size(), k_numbers}},
                        "[" + std::to_string(values.size()) + ", " + std::to_string(k_numbers) + "]");
  }
  auto* out = static_cast<Element*>(array.data);
  for (const Value& value : values) {
    if constexpr (k_numbers == 1) {
      *out++ = static_cast<Element>(value);
    } else {
      for (int k = 0; k < static_cast<int>(k_numbers); ++k) *out++ = static_cast<Element>(value[k]);
    }
  }
}

void read_cut(const batch::CutFaces& cut, const batch::NamedArray& array) {
  constexpr const std::int64_t* k_whole = nullptr;
  constexpr const float* k_float = nullptr;
  if (array.name == "faces") return copy_to(array, batch::Element::int64, cut.faces, k_whole);
  if (array.name == "face_of") return copy_to(array, batch::Element::int64, cut.face_of, k_whole);
  if (array.name == "vertices_of") return copy_to(array, batch::Element::int64, cut.vertices_of, k_whole);
  if (array.name == "vertex_weights")
    return copy_to(array, batch::Element::float32, cut.vertex_weights, k_float);
  throw InvalidArgument("name (cut)", "\"" + array.name + "\"",
                        "faces, face_of, vertices_of or vertex_weights");
}

}  // namespace
}  // namespace dpr::c

const char* dpr_frame_settings() {
  static const std::string names = [] {
    std::string all;
    for (const std::string_view name : dpr::batch::setting_names())
      all.append(all.empty() ? "" : ", ").append(name);
    return all;
  }();
  return names.c_str();
}

dpr_status dpr_frame_check(const dpr_frame_options* options) {
  return guarded([&] { to_settings(to_options(options)); });
}

dpr_status dpr_frame_render(const dpr_frame_options* options, const dpr_array* arrays, std::size_t count,
                            dpr_frame** frame) {
  return guarded([&] {
    deref(frame, "frame");
    const dpr_frame_options given = to_options(options);
    const dpr::batch::RenderSettings settings = to_settings(given);
    const std::vector<dpr::batch::NamedArray> named = to_arrays(arrays, count, "arrays");
    const dpr::batch::BatchOptions how{settings, given.is_lit != 0, given.first_view,
                                       to_words(given.gradients, given.gradient_count, "gradients")};
    auto pool = dpr::batch::RendererPools::of_process().get(given.device ? given.device : "");
    give(frame, std::make_unique<dpr::batch::Batch>(std::move(pool), named, how));
  });
}

dpr_status dpr_frame_read(dpr_frame* frame, const dpr_array* outputs, std::size_t count) {
  return guarded([&] { deref(frame, "frame").batch->read(to_arrays(outputs, count, "outputs")); });
}

dpr_status dpr_frame_backward(dpr_frame* frame, const dpr_array* grads, std::size_t grad_count,
                              const dpr_array* gradients, std::size_t gradient_count) {
  return guarded([&] {
    deref(frame, "frame")
        .batch->backward(to_arrays(grads, grad_count, "grads"),
                         to_arrays(gradients, gradient_count, "gradients"));
  });
}

dpr_status dpr_frame_is_empty(dpr_frame* frame, int* is_empty) {
  return guarded([&] { deref(is_empty, "is_empty") = deref(frame, "frame").batch->is_empty() ? 1 : 0; });
}

void dpr_frame_destroy(dpr_frame* frame) { destroy(frame); }

dpr_status dpr_frames_release() {
  return guarded([] { dpr::batch::RendererPools::of_process().clear(); });
}

dpr_status dpr_cut_create(const dpr_frame_options* options, const dpr_array* arrays, std::size_t count,
                          float tolerance, dpr_cut** cut) {
  return guarded([&] {
    deref(cut, "cut");
    const dpr::batch::RenderSettings settings = to_settings(to_options(options));
    give(cut, dpr::batch::cut_for_lens(to_arrays(arrays, count, "arrays"), settings, tolerance));
  });
}

dpr_status dpr_cut_size(const dpr_cut* cut, std::size_t* faces, std::size_t* vertices) {
  return guarded([&] {
    const dpr::batch::CutFaces& pieces = deref(cut, "cut").faces;
    deref(faces, "faces");
    deref(vertices, "vertices") = pieces.vertices_of.size();
    *faces = pieces.faces.size();
  });
}

dpr_status dpr_cut_read(const dpr_cut* cut, const dpr_array* arrays, std::size_t count) {
  return guarded([&] {
    for (const dpr::batch::NamedArray& array : to_arrays(arrays, count, "arrays"))
      read_cut(deref(cut, "cut").faces, array);
  });
}

void dpr_cut_destroy(dpr_cut* cut) { destroy(cut); }
