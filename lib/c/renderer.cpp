// Renderers of the C interface.
#include "c/buffers.hpp"
#include "renderer/renderer_impl.hpp"
#include "scene/scene_parts.hpp"

using namespace dpr::c;

namespace dpr::c {
namespace {

constexpr std::size_t k_matrix = 16;  // floats

std::vector<View> to_views(const Scene& scene, const dpr_camera* cameras, std::size_t count,
                           std::span<const float> transforms) {
  const std::size_t meshes = scene.meshes.size();
  std::vector<View> views(count);
  // Every camera is as long as its program's version of the struct.
  const std::size_t stride = deref(cameras, "cameras").size;
  for (std::size_t v = 0; v < count; ++v) {
    const auto* camera =
        reinterpret_cast<const dpr_camera*>(reinterpret_cast<const char*>(cameras) + v * stride);
    views[v].camera = to_camera(camera, "cameras");
    for (std::size_t m = 0; m < meshes; ++m) {
      views[v].transforms.push_back(transforms.empty() ? scene.meshes[m].transform
                                                       : to_matrix(&transforms[(v * meshes + m) * k_matrix]));
    }
  }
  return views;
}

std::size_t floats_of_images(const Renderer& renderer) {
  impl_of(renderer).require_scene("image");
  return image_floats(renderer.views().size(), renderer.scene().width, renderer.scene().height);
}

dpr_status set_floats(dpr_renderer* renderer, const ArrayRef& at, const float* values, std::size_t count) {
  return guarded([&] {
    Renderer& r = renderer_of(renderer);
    const MeshArray& row = row_of(at.id);
    const std::span<const float> floats = numbers(values, count, row.components, row.name);
    if (row.components == 2) {
      r.set_array(at, to_pairs(floats));
    } else if (row.components == 1) {
      r.set_array(at, floats);
    } else {
      r.set_array(at, to_vectors(floats));
    }
  });
}

dpr_status set_from(dpr_renderer* renderer, const ArrayRef& at, const dpr_buffer* values,
                    const dpr_events* events) {
  return guarded([&] {
    dpr::set_array(renderer_of(renderer), at, to_span(values, row_of(at.id).name), to_events(events));
  });
}

}  // namespace
}  // namespace dpr::c

dpr_status dpr_renderer_create(const dpr_device* device, dpr_renderer** renderer) {
  return guarded([&] {
    deref(renderer, "renderer");
    give(renderer, dpr::Renderer(deref(device, "device").device));
  });
}

dpr_status dpr_renderer_set_scene(dpr_renderer* renderer, const dpr_scene* scene) {
  return guarded([&] { renderer_of(renderer).set_scene(resolved(deref(scene, "scene"))); });
}

dpr_status dpr_renderer_set_views(dpr_renderer* renderer, const dpr_camera* cameras, std::size_t views,
                                  const float* transforms, std::size_t transform_count) {
  return guarded([&] {
    dpr::Renderer& r = renderer_of(renderer);
    require_views(views);
    std::span<const float> values;
    if (transforms || transform_count > 0) {
      values = numbers(transforms, transform_count, k_matrix, "transforms");
      require_count(transform_count, views * r.scene().meshes.size() * k_matrix, "transforms");
    }
    r.set_views(to_views(r.scene(), cameras, views, values));
  });
}

dpr_status dpr_renderer_set_positions(dpr_renderer* renderer, std::size_t mesh, const float* positions,
                                      std::size_t count) {
  return set_floats(renderer, {dpr::ArrayId::positions, mesh}, positions, count);
}

dpr_status dpr_renderer_set_colors(dpr_renderer* renderer, std::size_t mesh, const float* colors,
                                   std::size_t count) {
  return set_floats(renderer, {dpr::ArrayId::colors, mesh}, colors, count);
}

dpr_status dpr_renderer_set_texels(dpr_renderer* renderer, std::size_t mesh, std::size_t texture,
                                   const float* texels, std::size_t count) {
  return set_floats(renderer, {dpr::ArrayId::texels, mesh, texture}, texels, count);
}

dpr_status dpr_renderer_set_texcoords(dpr_renderer* renderer, std::size_t mesh, const float* texcoords,
                                      std::size_t count) {
  return set_floats(renderer, {dpr::ArrayId::texcoords, mesh}, texcoords, count);
}

dpr_status dpr_renderer_set_normals(dpr_renderer* renderer, std::size_t mesh, const float* normals,
                                    std::size_t count) {
  return set_floats(renderer, {dpr::ArrayId::normals, mesh}, normals, count);
}

dpr_status dpr_renderer_set_materials(dpr_renderer* renderer, std::size_t mesh, const dpr_material* materials,
                                      std::size_t count) {
  return guarded([&] {
    dpr::Renderer& r = renderer_of(renderer);
    r.set_materials(mesh, to_materials(materials, count, "materials"));
  });
}

dpr_status dpr_renderer_set_opacities(dpr_renderer* renderer, std::size_t mesh, const float* opacities,
                                      std::size_t count) {
  return set_floats(renderer, {dpr::ArrayId::opacities, mesh}, opacities, count);
}

dpr_status dpr_renderer_set_texel_opacities(dpr_renderer* renderer, std::size_t mesh, std::size_t texture,
                                            const float* opacities, std::size_t count) {
  return set_floats(renderer, {dpr::ArrayId::texel_opacities, mesh, texture}, opacities, count);
}

dpr_status dpr_renderer_set_positions_from(dpr_renderer* renderer, std::size_t mesh,
                                           const dpr_buffer* positions, const dpr_events* events) {
  return set_from(renderer, {dpr::ArrayId::positions, mesh}, positions, events);
}

dpr_status dpr_renderer_set_colors_from(dpr_renderer* renderer, std::size_t mesh, const dpr_buffer* colors,
                                        const dpr_events* events) {
  return set_from(renderer, {dpr::ArrayId::colors, mesh}, colors, events);
}

dpr_status dpr_renderer_set_texels_from(dpr_renderer* renderer, std::size_t mesh, std::size_t texture,
                                        const dpr_buffer* texels, const dpr_events* events) {
  return set_from(renderer, {dpr::ArrayId::texels, mesh, texture}, texels, events);
}

dpr_status dpr_renderer_set_texcoords_from(dpr_renderer* renderer, std::size_t mesh,
                                           const dpr_buffer* texcoords, const dpr_events* events) {
  return set_from(renderer, {dpr::ArrayId::texcoords, mesh}, texcoords, events);
}

dpr_status dpr_renderer_set_normals_from(dpr_renderer* renderer, std::size_t mesh, const dpr_buffer* normals,
                                         const dpr_events* events) {
  return set_from(renderer, {dpr::ArrayId::normals, mesh}, normals, events);
}

dpr_status dpr_renderer_set_materials_from(dpr_renderer* renderer, std::size_t mesh,
                                           const dpr_buffer* materials, const dpr_events* events) {
  return set_from(renderer, {dpr::ArrayId::materials, mesh}, materials, events);
}

dpr_status dpr_renderer_set_opacities_from(dpr_renderer* renderer, std::size_t mesh,
                                           const dpr_buffer* opacities, const dpr_events* events) {
  return set_from(renderer, {dpr::ArrayId::opacities, mesh}, opacities, events);
}

dpr_status dpr_renderer_set_texel_opacities_from(dpr_renderer* renderer, std::size_t mesh,
                                                 std::size_t texture, const dpr_buffer* opacities,
                                                 const dpr_events* events) {
  return set_from(renderer, {dpr::ArrayId::texel_opacities, mesh, texture}, opacities, events);
}

dpr_status dpr_renderer_set_shapes(dpr_renderer* renderer, const float* positions, std::size_t position_count,
                                   const float* colors, std::size_t color_count) {
  return guarded([&] {
    dpr::Renderer& r = renderer_of(renderer);
    const auto optional_vectors = [](const float* values, std::size_t count, const char* argument) {
      return values || count > 0 ? to_vectors(numbers(values, count, 3, argument)) : std::vector<glm::vec3>();
    };
    r.set_shapes(optional_vectors(positions, position_count, "positions"),
                 optional_vectors(colors, color_count, "colors"));
  });
}

dpr_status dpr_renderer_set_lights(dpr_renderer* renderer, const dpr_lights* lights) {
  return guarded([&] { renderer_of(renderer).set_lights(to_lights(lights)); });
}

dpr_status dpr_renderer_set_smoothing(dpr_renderer* renderer, const dpr_scene* scene) {
  return guarded([&] { renderer_of(renderer).set_smoothing(smoothing_of(deref(scene, "scene"))); });
}

dpr_status dpr_renderer_set_background(dpr_renderer* renderer, const float color[3]) {
  return guarded([&] { renderer_of(renderer).set_background(to_vector(&deref(color, "color"))); });
}

dpr_status dpr_renderer_set_cull(dpr_renderer* renderer, const char* word) {
  return guarded([&] { renderer_of(renderer).set_cull(dpr::parse_cull(&deref(word, "word"), "word")); });
}

dpr_status dpr_renderer_set_gradients(dpr_renderer* renderer, const char* const* names, std::size_t count) {
  return guarded([&] { renderer_of(renderer).set_gradients(to_request(names, count)); });
}

dpr_status dpr_renderer_forward(dpr_renderer* renderer) {
  return guarded([&] { renderer_of(renderer).forward(); });
}

dpr_status dpr_renderer_image_size(const dpr_renderer* renderer, std::size_t* count) {
  return guarded([&] {
    deref(count, "count");
    *count = floats_of_images(renderer_of(renderer));
  });
}

dpr_status dpr_renderer_read_image(const dpr_renderer* renderer, float* pixels, std::size_t count) {
  return guarded([&] {
    const dpr::Renderer& r = renderer_of(renderer);
    r.read_pixels(to_pixels(pixels, count, floats_of_images(r)));
  });
}

dpr_status dpr_renderer_image_buffer(const dpr_renderer* renderer, struct _cl_mem** buffer) {
  return guarded([&] {
    deref(buffer, "buffer");
    *buffer = dpr::image_handle(renderer_of(renderer));
  });
}

void dpr_renderer_destroy(dpr_renderer* renderer) { destroy(renderer); }
