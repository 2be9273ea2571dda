// Frames of named arrays in the C interface: arrays in, the renderer's launches, arrays out.
#include "batch/batch.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <set>
#include <string_view>
#include <utility>

#include "batch/inputs.hpp"
#include "c/handles.hpp"
#include "dpr/aov.hpp"
#include "dpr/error.hpp"
#include "renderer/renderer_impl.hpp"
#include "renderer/setter_checks.hpp"

namespace dpr::batch {
namespace {

constexpr std::array<std::string_view, 4> k_attributes{"depth", "position", "normal", "texcoords"};

bool is_attribute(std::string_view output) {
  return std::ranges::find(k_attributes, output) != k_attributes.end();
}

Attribute attribute_of(const NamedArray& output) { return parse_attribute(output.name, "outputs (batch)"); }

/// One view that every valid smoothing goes with, and all lights.
View neutral_view() {
  constexpr float k_longest = 1e36F;  // of the lengths that require_scales() lets pass, for any gamma
  View view{{}, {glm::mat4(1.0F)}};
  view.camera.znear = 1;
  view.camera.zfar = k_longest;
  return view;
}

/// Throws InvalidArgument, which says of which view, for lights that a renderer refuses.
void check_lights_of_views(const Renderer::Impl& m, std::span<const Lights> lights) {
  for (std::size_t view = 0; view < lights.size(); ++view) {
    try {
      check_lights(m.scene, m.views, lights[view]);
    } catch (const InvalidArgument& error) {
      if (lights.size() == 1) throw;
      throw InvalidArgument(error.argument() + " (view " + std::to_string(view) + ")", error.got(),
                            error.expected());
    }
  }
}

/// Smoothing, lights and views, each of which its setter checks against the others. Until all are set some
/// are those of the renderer's last batch, which need not go with these.
void upload_settings(Renderer& renderer, std::span<const View> views, std::span<const Lights> lights,
                     const Smoothing& smoothing, std::size_t first_view) {
  Renderer::Impl& m = impl_of(renderer);
  const auto set = [&] {
    if (m.scene.smoothing != smoothing) renderer.set_smoothing(smoothing);
    check_lights_of_views(m, lights);
    if (!lights.empty() || m.scene.lights) m.set_lights(lights);
    renderer.set_views(views, first_view);
  };
  try {
    set();
  } catch (const InvalidArgument&) {
    renderer.set_views(std::array{neutral_view()});
    set();
  }
}

/// Opacities of the last batch need not go with the next one's smoothing.
void make_opaque(Renderer& renderer) {
  const Mesh& mesh = renderer.scene().meshes[0].mesh;
  const std::vector<float> ones(mesh.vertex_opacities.size() + mesh.face_opacities.size(), 1.0F);
  if (!ones.empty()) renderer.set_opacities(0, ones);
  for (std::size_t i = 0; i < mesh.textures.size(); ++i) {
    const std::vector<float> of_texture(mesh.textures[i].opacities.size(), 1.0F);
    if (!of_texture.empty()) renderer.set_texel_opacities(0, i, of_texture);
  }
}

/// The vectors of an array, [n][3] or [view][n][3], once for every view.
std::vector<glm::vec3> repeated(std::span<const glm::vec3> vectors, bool is_own, std::size_t views) {
  std::vector<glm::vec3> all;
  all.reserve(vectors.size() * (is_own ? 1 : views));
  for (std::size_t v = 0; v < (is_own ? 1 : views); ++v)
    all.insert(all.end(), vectors.begin(), vectors.end());
  return all;
}

/// Gradients of an attribute's images, which depend on nothing else.
GradientRequest request_of_attribute(std::span<const std::string> names, Attribute attribute) {
  GradientRequest request = request_of(names, false);
  request.texcoords = request.texcoords && attribute == Attribute::texcoords;
  request.colors = request.background = request.lights = request.texture = request.materials = false;
  request.opacities = request.texel_opacities = false;
  return request;
}

template <typename Value>
Value* write_view(const std::vector<Value>& values, Value* out) {
  return std::ranges::copy(values, out).out;
}

/// An output without gradients.
void write_output(const std::vector<AuxiliaryOutputs>& views, const NamedArray& output) {
  for (std::size_t v = 0; v < views.size(); ++v) {
    const AuxiliaryOutputs& from = views[v];
    const std::size_t pixels = from.face_id.size();
    if (output.name == "face_id") {
      const auto first = static_cast<std::int64_t*>(output.data) + v * pixels;
      std::ranges::copy(from.face_id, first);
    } else if (output.name == "barycentrics") {
      write_view(from.barycentrics, static_cast<glm::vec3*>(output.data) + v * pixels);
    } else if (output.name == "uv") {
      if (from.uv.empty())
        throw InvalidArgument("outputs (batch)", "uv of a mesh without texture coordinates",
                              "texture coordinates on all meshes");
      write_view(from.uv, static_cast<glm::vec2*>(output.data) + v * pixels);
    } else {
      write_view(from.effective_faces, static_cast<float*>(output.data) + v * pixels);
    }
  }
}

std::size_t channels_of(const std::string& output) {
  if (output == "image" || is_attribute(output)) return 4;
  if (output == "barycentrics") return 3;
  if (output == "uv") return 2;
  if (output == "face_id" || output == "effective_faces") return 0;
  throw InvalidArgument(
      "outputs (batch)", "'" + output + "'",
      "image, depth, position, normal, texcoords, face_id, barycentrics, uv or effective_faces");
}

}  // namespace

GradientRequest request_of(std::span<const std::string> names, bool with_affine_views) {
  GradientRequest request = no_gradients();
  for (const std::string& name : names) {
    if (name == "views") (with_affine_views ? request.positions : request.camera) = true;
    for (const GradientRow* const row : gradient_rows_of(name)) request.*row->wanted = true;
  }
  return request;
}

Batch::Batch(std::shared_ptr<RendererPool> pool, NamedArrays arrays, const BatchOptions& options)
    : frame_(std::move(pool), make_topology(arrays, options.settings)), wanted_(options.gradients) {
  require_numbers_of(wanted_, arrays);
  const RenderSettings settings = with_numbers(options.settings, arrays);
  const std::vector<View> views = make_views(arrays, settings);
  const std::vector<Lights> lights = make_lights(arrays, options, views.size());
  Renderer& renderer = frame_.renderer();
  make_opaque(renderer);
  upload_settings(renderer, views, lights, settings.smoothing(), options.first_view);
  renderer.set_cull(settings.cull());
  renderer.set_layers(settings.layers());
  const NamedArray* const background = find(arrays, "background");
  renderer.set_background(background ? background->rows<const glm::vec3>()[0] : glm::vec3(0.0F));
  upload_surface(renderer, arrays);

  const auto vertices = require(arrays, "vertices").rows<const glm::vec3>();
  const std::size_t count = renderer.scene().meshes[0].mesh.positions.size();
  const bool needs_affine = lights.empty() && std::ranges::find(wanted_, "views") != wanted_.end();
  const bool is_own = vertices.size() > count;
  if (needs_affine) vertices_ = repeated(vertices, is_own, views.size());
  const bool own_shapes = views.size() > 1 && (is_own || needs_affine);
  if (!own_shapes) renderer.set_positions(0, vertices);
  const NamedArray* const given = find_colors(arrays);
  const auto colors = given ? given->rows<const glm::vec3>() : std::span<const glm::vec3>();
  const bool own_colors = given && views.size() > 1 && given->shape.size() == 3 && given->shape[0] > 1;
  if (!own_colors) {
    renderer.set_colors(0, given ? colors : std::vector<glm::vec3>(count, glm::vec3(1.0F)));
  }
  std::span<const glm::vec3> shapes;
  if (own_shapes) shapes = needs_affine ? std::span<const glm::vec3>(vertices_) : vertices;
  renderer.set_shapes(shapes, own_colors ? colors : std::span<const glm::vec3>());
  renderer.set_gradients(request_of(wanted_, needs_affine));
  impl_of(renderer).wants_samples_alone = options.defers_image;
  renderer.forward();
}

void Batch::require_image(const NamedArray& array, std::size_t channels) {
  const Renderer& renderer = frame_.renderer();
  const std::size_t views = renderer.views().size(),
                    height = static_cast<std::size_t>(renderer.scene().height),
                    width = static_cast<std::size_t>(renderer.scene().width);
  const std::string expected = "[" + std::to_string(views) + ", " + std::to_string(height) + ", " +
                               std::to_string(width) +
                               (channels ? ", " + std::to_string(channels) + "]" : "]");
  const Element element = array.name == "face_id" ? Element::int64 : Element::float32;
  if (channels) {
    require_form(array, element, {{views, height, width, channels}}, expected);
  } else {
    require_form(array, element, {{views, height, width}}, expected);
  }
}

void Batch::read(NamedArrays outputs) {
  Renderer& renderer = frame_.renderer();
  for (const NamedArray& output : outputs) require_image(output, channels_of(output.name));
  impl_of(renderer).require_image();
  std::vector<AuxiliaryOutputs> auxiliary;
  for (const NamedArray& output : outputs) {
    if (output.name == "image") {
      renderer.read_pixels(output.rows<glm::vec4>());
    } else if (is_attribute(output.name)) {
      const Attribute attribute = attribute_of(output);
      renderer.set_gradients(request_of_attribute(wanted_, attribute));
      AttributeImages& images = frame_.attribute_images(attribute);
      images.forward(renderer);
      glm::vec4* next = output.rows<glm::vec4>().data();
      for (std::size_t v = 0; v < renderer.views().size(); ++v)
        next = std::ranges::copy(images.image(v).pixels, next).out;
    } else {
      if (auxiliary.empty()) {
        for (std::size_t v = 0; v < renderer.views().size(); ++v)
          auxiliary.push_back(auxiliary_outputs(renderer, v));
      }
      write_output(auxiliary, output);
    }
  }
}

void Batch::start_gradients(NamedArrays gradients) {
  for (const NamedArray& gradient : gradients) {
    if (std::ranges::find(wanted_, gradient.name) == wanted_.end())
      throw InvalidArgument(argument(gradient), "a gradient that was not asked for when it was rendered",
                            "one of those in `gradients` of the frame's options");
    if (gradient.element != Element::float32) throw InvalidArgument(argument(gradient), "indices", "float32");
    std::ranges::fill(gradient.rows<float>(), 0.0F);
  }
}

void Batch::backward(NamedArrays grads, NamedArrays gradients) {
  Renderer& renderer = frame_.renderer();
  start_gradients(gradients);
  impl_of(renderer).require_image();
  for (const NamedArray& grad : grads) {
    require_image(grad, channels_of(grad.name));
    const auto pixels = grad.rows<const glm::vec4>();
    if (grad.name == "image") {
      const bool is_affine = !renderer.scene().lights;
      renderer.set_gradients(request_of(wanted_, is_affine));
      SceneGradient found = renderer.backward_pixels(pixels);
      add_gradients(found, is_affine, gradients);
    } else if (is_attribute(grad.name)) {
      const Scene& scene = renderer.scene();
      std::vector<Image> images(renderer.views().size(), Image(scene.width, scene.height));
      const glm::vec4* next = pixels.data();
      for (Image& image : images) {
        std::copy_n(next, image.pixels.size(), image.pixels.begin());
        next += image.pixels.size();
      }
      SceneGradient found = frame_.attribute_images(attribute_of(grad)).backward(images);
      add_gradients(found, false, gradients);
    } else {
      throw InvalidArgument(argument(grad), "an output without gradients",
                            "image, depth, position, normal or texcoords");
    }
  }
}

std::size_t Batch::image_floats() {
  const Renderer& renderer = frame_.renderer();
  return c::image_floats(renderer.views().size(), renderer.scene().width, renderer.scene().height);
}

bool Batch::is_empty() {
  const Renderer& renderer = frame_.renderer();
  impl_of(renderer).require_forward("dpr_frame_is_empty");
  // The statistics read a word of every triangle from the device, which only a frame without fragments needs.
  if (impl_of(renderer).rasterize.frame_fragments > 0) return false;
  const RenderStatistics statistics = renderer.statistics();
  return statistics.faces_dropped == statistics.faces;
}

namespace {

constexpr int k_most_dimensions = 4;
constexpr std::size_t k_most_words = 1U << 16U;

}  // namespace

std::vector<std::string> to_words(const char* const* words, std::size_t count, const char* argument) {
  if (count > 0) c::deref(words, argument);
  if (count > k_most_words)
    throw InvalidArgument(argument, std::to_string(count), "at most " + std::to_string(k_most_words));
  std::vector<std::string> copies;
  for (const char* word : std::span(words, count)) copies.emplace_back(&c::deref(word, argument));
  return copies;
}

std::vector<NamedArray> to_arrays(const dpr_array* arrays, std::size_t count, const char* argument) {
  if (count > 0) c::deref(arrays, argument);
  if (count > k_most_words)
    throw InvalidArgument(argument, std::to_string(count), "at most " + std::to_string(k_most_words));
  std::vector<NamedArray> named;
  std::set<std::string_view> names;
  for (const dpr_array& array : std::span(arrays, count)) {
    const std::string name = &c::deref(array.name, "name (array)");
    if (!names.insert(array.name).second)
      throw InvalidArgument("name (array)", "'" + name + "' twice", "each name once");
    if (array.element < DPR_FLOAT32 || array.element > DPR_INT64)
      throw InvalidArgument("element (" + name + ")", std::to_string(array.element), "a dpr_element");
    if (array.dimensions < 0 || array.dimensions > k_most_dimensions)
      throw InvalidArgument("dimensions (" + name + ")", std::to_string(array.dimensions), "0 to 4");
    named.push_back({name,
                     array.data,
                     static_cast<Element>(array.element),
                     {array.shape, array.shape + array.dimensions}});
    std::size_t room = std::numeric_limits<std::size_t>::max() / sizeof(std::int64_t);
    for (const std::size_t side : named.back().shape) room /= std::max<std::size_t>(side, 1);
    if (room == 0)
      throw InvalidArgument(name + " (array)", text_of(named.back().shape),
                            "a shape that memory has room for");
    if (named.back().count() > 0 && !array.data) throw InvalidArgument(name, "NULL", "a pointer");
  }
  return named;
}

RenderSettings to_settings(const dpr_frame_options& options) {
  return settings_from_texts(options.width, options.height,
                             to_words(options.settings, options.setting_count, "settings"));
}

dpr_frame_options to_options(const dpr_frame_options* options) {
  return c::versioned<dpr_frame_options>(options, DPR_FRAME_OPTIONS_INIT, "options");
}

}  // namespace dpr::batch

using namespace dpr::c;

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
  return guarded([&] { dpr::batch::to_settings(dpr::batch::to_options(options)); });
}

dpr_status dpr_frame_render(const dpr_frame_options* options, const dpr_array* arrays, std::size_t count,
                            dpr_frame** frame) {
  return guarded([&] {
    deref(frame, "frame");
    const dpr_frame_options given = dpr::batch::to_options(options);
    const dpr::batch::RenderSettings settings = dpr::batch::to_settings(given);
    const std::vector<dpr::batch::NamedArray> named = dpr::batch::to_arrays(arrays, count, "arrays");
    const dpr::batch::BatchOptions how{
        settings, given.is_lit != 0, given.first_view,
        dpr::batch::to_words(given.gradients, given.gradient_count, "gradients"), given.defers_image != 0};
    auto pool = dpr::batch::RendererPools::of_process().get(given.device ? given.device : "");
    give(frame, std::make_unique<dpr::batch::Batch>(std::move(pool), named, how));
  });
}

dpr_status dpr_frame_read(dpr_frame* frame, const dpr_array* outputs, std::size_t count) {
  return guarded(
      [&] { deref(frame, "frame").batch->read(dpr::batch::to_arrays(outputs, count, "outputs")); });
}

dpr_status dpr_frame_backward(dpr_frame* frame, const dpr_array* grads, std::size_t grad_count,
                              const dpr_array* gradients, std::size_t gradient_count) {
  return guarded([&] {
    deref(frame, "frame")
        .batch->backward(dpr::batch::to_arrays(grads, grad_count, "grads"),
                         dpr::batch::to_arrays(gradients, gradient_count, "gradients"));
  });
}

dpr_status dpr_frame_tangent(dpr_frame* frame, std::size_t directions, const dpr_array* tangents,
                             std::size_t tangent_count, float* pixels, std::size_t pixel_count) {
  return guarded([&] {
    dpr::batch::Batch& batch = *deref(frame, "frame").batch;
    const std::size_t floats = batch.image_floats();
    if (directions == 0 || directions > std::numeric_limits<std::size_t>::max() / floats)
      throw dpr::InvalidArgument("directions", std::to_string(directions),
                                 "at least 1, with images in memory");
    batch.tangent(directions, dpr::batch::to_arrays(tangents, tangent_count, "tangents"),
                  to_pixels(pixels, pixel_count, directions * floats));
  });
}

dpr_status dpr_frame_is_empty(dpr_frame* frame, int* is_empty) {
  return guarded([&] { deref(is_empty, "is_empty") = deref(frame, "frame").batch->is_empty() ? 1 : 0; });
}

void dpr_frame_destroy(dpr_frame* frame) { destroy(frame); }

dpr_status dpr_frames_release() {
  return guarded([] { dpr::batch::RendererPools::of_process().clear(); });
}
