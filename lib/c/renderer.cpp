// Renderers and losses of the C interface.
#include <cstddef>
#include <cstring>

#include "base/checks.hpp"
#include "c/handles.hpp"
#include "dpr/opencl_handles.hpp"
#include "scene/cull.hpp"

using dpr::InvalidArgument;
using dpr::c::deref;
using dpr::c::give;
using dpr::c::guarded;
using dpr::c::numbers;

namespace dpr::c {

void require_count(std::size_t count, std::size_t expected, const char* argument) {
  if (count == expected) return;
  throw InvalidArgument(std::string("count (") + argument + ")", std::to_string(count),
                        std::to_string(expected));
}

namespace {

constexpr std::size_t k_pixel = 4;    // floats
constexpr std::size_t k_matrix = 16;  // floats
/// More views than any device has memory for: a count beyond is a mistake.
constexpr std::size_t k_most_views = 1U << 24U;

void require_views(std::size_t views) {
  if (views > 0 && views <= k_most_views) return;
  throw InvalidArgument("views", std::to_string(views), "1 to " + std::to_string(k_most_views));
}

/// Pixels have the layout of glm::vec4.
std::span<const glm::vec4> to_pixels(std::span<const float> values) {
  return {reinterpret_cast<const glm::vec4*>(values.data()), values.size() / k_pixel};
}

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

std::vector<Image> to_images(std::span<const float> values, std::size_t views, int width, int height) {
  std::vector<Image> images(views, Image(width, height));
  const std::size_t size = images.front().pixels.size();
  const std::span<const glm::vec4> pixels = to_pixels(values);
  for (std::size_t v = 0; v < views; ++v)
    std::ranges::copy(pixels.subspan(v * size, size), images[v].pixels.begin());
  return images;
}

std::size_t image_floats(const Renderer& renderer) {
  const Scene& scene = renderer.scene();
  return renderer.views().size() * static_cast<std::size_t>(scene.width) *
         static_cast<std::size_t>(scene.height) * k_pixel;
}

/// What a program's version of the struct has. The first was padded to where robust begins.
LossWeights to_weights(const dpr_loss_weights* given) {
  const auto weights = versioned<dpr_loss_weights>(given, DPR_LOSS_WEIGHTS_INIT, "weights");
  LossWeights converted{.mse = weights.mse, .l1 = weights.l1, .silhouette = weights.silhouette};
  if (weights.size <= offsetof(dpr_loss_weights, robust_scale)) return converted;
  converted.robust = weights.robust;
  converted.robust_scale = weights.robust_scale;
  converted.ssim = weights.ssim;
  return converted;
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
  return guarded([&] {
    deref(renderer, "renderer");
    dpr::Scene resolved = deref(scene, "scene").scene;
    resolved.smoothing = dpr::c::smoothing_of(*scene);
    renderer->renderer.set_scene(resolved);
  });
}

dpr_status dpr_renderer_set_views(dpr_renderer* renderer, const dpr_camera* cameras, std::size_t views,
                                  const float* transforms, std::size_t transform_count) {
  return guarded([&] {
    dpr::Renderer& r = deref(renderer, "renderer").renderer;
    dpr::c::require_views(views);
    std::span<const float> values;
    if (transforms || transform_count > 0) {
      values = numbers(transforms, transform_count, dpr::c::k_matrix, "transforms");
      dpr::c::require_count(transform_count, views * r.scene().meshes.size() * dpr::c::k_matrix,
                            "transforms");
    }
    r.set_views(dpr::c::to_views(r.scene(), cameras, views, values));
  });
}

dpr_status dpr_renderer_set_positions(dpr_renderer* renderer, std::size_t mesh, const float* positions,
                                      std::size_t count) {
  return guarded([&] {
    dpr::Renderer& r = deref(renderer, "renderer").renderer;
    r.set_positions(mesh, dpr::c::to_vectors(numbers(positions, count, 3, "positions")));
  });
}

dpr_status dpr_renderer_set_colors(dpr_renderer* renderer, std::size_t mesh, const float* colors,
                                   std::size_t count) {
  return guarded([&] {
    dpr::Renderer& r = deref(renderer, "renderer").renderer;
    r.set_colors(mesh, dpr::c::to_vectors(numbers(colors, count, 3, "colors")));
  });
}

dpr_status dpr_renderer_set_texels(dpr_renderer* renderer, std::size_t mesh, std::size_t texture,
                                   const float* texels, std::size_t count) {
  return guarded([&] {
    dpr::Renderer& r = deref(renderer, "renderer").renderer;
    r.set_texels(mesh, texture, dpr::c::to_vectors(numbers(texels, count, 3, "texels")));
  });
}

dpr_status dpr_renderer_set_texcoords(dpr_renderer* renderer, std::size_t mesh, const float* texcoords,
                                      std::size_t count) {
  return guarded([&] {
    dpr::Renderer& r = deref(renderer, "renderer").renderer;
    r.set_texcoords(mesh, dpr::c::to_pairs(numbers(texcoords, count, 2, "texcoords")));
  });
}

dpr_status dpr_renderer_set_normals(dpr_renderer* renderer, std::size_t mesh, const float* normals,
                                    std::size_t count) {
  return guarded([&] {
    dpr::Renderer& r = deref(renderer, "renderer").renderer;
    r.set_normals(mesh, dpr::c::to_vectors(numbers(normals, count, 3, "normals")));
  });
}

dpr_status dpr_renderer_set_materials(dpr_renderer* renderer, std::size_t mesh, const dpr_material* materials,
                                      std::size_t count) {
  return guarded([&] {
    dpr::Renderer& r = deref(renderer, "renderer").renderer;
    r.set_materials(mesh, dpr::c::to_materials(materials, count, "materials"));
  });
}

dpr_status dpr_renderer_set_shapes(dpr_renderer* renderer, const float* positions, std::size_t position_count,
                                   const float* colors, std::size_t color_count) {
  return guarded([&] {
    dpr::Renderer& r = deref(renderer, "renderer").renderer;
    const auto optional_vectors = [](const float* values, std::size_t count, const char* argument) {
      return values || count > 0 ? dpr::c::to_vectors(numbers(values, count, 3, argument))
                                 : std::vector<glm::vec3>();
    };
    r.set_shapes(optional_vectors(positions, position_count, "positions"),
                 optional_vectors(colors, color_count, "colors"));
  });
}

dpr_status dpr_renderer_set_lights(dpr_renderer* renderer, const dpr_lights* lights) {
  return guarded([&] { deref(renderer, "renderer").renderer.set_lights(dpr::c::to_lights(lights)); });
}

dpr_status dpr_renderer_set_smoothing(dpr_renderer* renderer, const dpr_scene* scene) {
  return guarded([&] {
    deref(renderer, "renderer").renderer.set_smoothing(dpr::c::smoothing_of(deref(scene, "scene")));
  });
}

dpr_status dpr_renderer_set_background(dpr_renderer* renderer, const float color[3]) {
  return guarded([&] {
    deref(renderer, "renderer").renderer.set_background(dpr::c::to_vector(&deref(color, "color")));
  });
}

dpr_status dpr_renderer_set_cull(dpr_renderer* renderer, const char* word) {
  return guarded(
      [&] { deref(renderer, "renderer").renderer.set_cull(dpr::parse_cull(&deref(word, "word"), "word")); });
}

dpr_status dpr_renderer_set_gradients(dpr_renderer* renderer, const char* const* names, std::size_t count) {
  return guarded(
      [&] { deref(renderer, "renderer").renderer.set_gradients(dpr::c::to_request(names, count)); });
}

dpr_status dpr_renderer_forward(dpr_renderer* renderer) {
  return guarded([&] { deref(renderer, "renderer").renderer.forward(); });
}

dpr_status dpr_renderer_image_size(const dpr_renderer* renderer, std::size_t* count) {
  return guarded([&] {
    deref(count, "count");
    *count = dpr::c::image_floats(deref(renderer, "renderer").renderer);
  });
}

dpr_status dpr_renderer_read_image(const dpr_renderer* renderer, float* pixels, std::size_t count) {
  return guarded([&] {
    const dpr::Renderer& r = deref(renderer, "renderer").renderer;
    deref(pixels, "pixels");
    dpr::c::require_count(count, dpr::c::image_floats(r), "pixels");
    r.read_pixels({reinterpret_cast<glm::vec4*>(pixels), count / dpr::c::k_pixel});
  });
}

dpr_status dpr_renderer_image_buffer(const dpr_renderer* renderer, struct _cl_mem** buffer) {
  return guarded([&] {
    deref(buffer, "buffer");
    *buffer = dpr::image_handle(deref(renderer, "renderer").renderer);
  });
}

void dpr_renderer_destroy(dpr_renderer* renderer) { delete renderer; }

dpr_status dpr_loss_create(const dpr_device* device, const dpr_loss_weights* weights, const float* targets,
                           std::size_t count, std::size_t views, int width, int height, dpr_loss** loss) {
  return guarded([&] {
    deref(loss, "loss");
    deref(device, "device");
    const dpr::LossWeights wanted = dpr::c::to_weights(weights);
    dpr::c::require_views(views);
    constexpr int k_most = dpr::checks::k_largest_side;
    if (width < 1 || height < 1 || width > k_most || height > k_most) {
      throw InvalidArgument("size (targets)", dpr::checks::size(width, height),
                            "1 to " + std::to_string(k_most) + " pixels on a side");
    }
    const std::span<const float> values = numbers(targets, count, dpr::c::k_pixel, "targets");
    dpr::c::require_count(
        count, views * static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * dpr::c::k_pixel,
        "targets");
    const std::vector<dpr::Image> images = dpr::c::to_images(values, views, width, height);
    give(loss, dpr::ImageLoss(device->device, wanted, images));
  });
}

dpr_status dpr_loss_evaluate(dpr_loss* loss, const dpr_renderer* renderer, double* value) {
  return guarded([&] {
    deref(value, "value");
    *value = deref(loss, "loss").loss.evaluate(deref(renderer, "renderer").renderer);
  });
}

void dpr_loss_destroy(dpr_loss* loss) { delete loss; }

dpr_status dpr_mesh_loss_create(const dpr_device* device, const dpr_mesh_loss_weights* weights,
                                const dpr_mesh* mesh, dpr_mesh_loss** loss) {
  return guarded([&] {
    deref(loss, "loss");
    const auto w = dpr::c::versioned<dpr_mesh_loss_weights>(weights, DPR_MESH_LOSS_WEIGHTS_INIT, "weights");
    const dpr::Mesh shape = dpr::c::to_mesh(dpr::c::versioned<dpr_mesh>(mesh, DPR_MESH_INIT, "mesh"));
    give(loss, dpr::MeshLoss(deref(device, "device").device,
                             {.laplacian = w.laplacian,
                              .edge_length = w.edge_length,
                              .normal_consistency = w.normal_consistency,
                              .flatness = w.flatness,
                              .edge_target = w.edge_target},
                             shape));
  });
}

dpr_status dpr_mesh_loss_evaluate(dpr_mesh_loss* loss, const dpr_renderer* renderer, std::size_t mesh,
                                  double* value) {
  return guarded([&] {
    deref(value, "value");
    *value = deref(loss, "loss").loss.evaluate(deref(renderer, "renderer").renderer, mesh);
  });
}

void dpr_mesh_loss_destroy(dpr_mesh_loss* loss) { delete loss; }
