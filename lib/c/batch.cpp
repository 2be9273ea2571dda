// Batches of scenes in the C interface.
#include "c/buffers.hpp"

using dpr::InvalidArgument;
using namespace dpr::c;

namespace dpr::c {
namespace {

std::size_t floats_of_images(SceneBatch& batch) {
  if (batch.scenes() == 0) throw InvalidArgument("image (batch)", "no scenes", "set_scenes() first");
  const Scene& scene = batch.renderer(0).scene();
  return image_floats(batch.views(), scene.width, scene.height);
}

/// A handle a scene. `backward` computes the gradients, once it is known that there is room for the handles.
template <class Backward>
void give_gradients(dpr_gradient** out, std::size_t count, dpr_batch* handle, const Backward& backward) {
  SceneBatch& batch = batch_of(handle);
  deref(out, "gradients");
  if (count != batch.scenes())
    throw InvalidArgument("count (gradients)", std::to_string(count),
                          std::to_string(batch.scenes()) + ", one a scene");
  std::vector<SceneGradient> gradients = backward(batch);
  std::vector<std::unique_ptr<dpr_gradient, Destroy>> handles;
  for (std::size_t i = 0; i < count; ++i)
    handles.push_back(make_handle<dpr_gradient>(arrays_of(batch.renderer(i), std::move(gradients[i]))));
  for (std::size_t i = 0; i < count; ++i) out[i] = handles[i].release();
}

}  // namespace
}  // namespace dpr::c

dpr_status dpr_batch_create(const dpr_device* device, dpr_batch** batch) {
  return guarded([&] {
    deref(batch, "batch");
    give(batch, std::make_shared<dpr::SceneBatch>(deref(device, "device").device));
  });
}

dpr_status dpr_batch_set_scenes(dpr_batch* batch, const dpr_scene* const* scenes, std::size_t count) {
  return guarded([&] {
    dpr::SceneBatch& b = batch_of(batch);
    if (count > 0) deref(scenes, "scenes");
    std::vector<dpr::Scene> copies;
    for (const dpr_scene* scene : std::span(scenes, count))
      copies.push_back(resolved(deref(scene, "scenes")));
    b.set_scenes(copies);
  });
}

dpr_status dpr_batch_scene_renderer(const dpr_batch* batch, std::size_t scene, dpr_renderer** renderer) {
  return guarded([&] {
    deref(renderer, "renderer");
    deref(batch, "batch").batch->renderer(scene);  // throws for one that is not there
    give(renderer, dpr_renderer::OfBatch{batch->batch, scene});
  });
}

dpr_status dpr_batch_forward(dpr_batch* batch) {
  return guarded([&] { batch_of(batch).forward(); });
}

dpr_status dpr_batch_image_size(const dpr_batch* batch, std::size_t* count) {
  return guarded([&] { deref(count, "count") = floats_of_images(batch_of(batch)); });
}

dpr_status dpr_batch_read_image(const dpr_batch* batch, float* pixels, std::size_t count) {
  return guarded([&] {
    dpr::SceneBatch& b = batch_of(batch);
    b.read_pixels(to_pixels(pixels, count, floats_of_images(b)));
  });
}

dpr_status dpr_batch_image_view(dpr_batch* batch, dpr_buffer* view) {
  return guarded([&] { fill(view, dpr::image_view(batch_of(batch))); });
}

dpr_status dpr_batch_backward_loss(dpr_batch* batch, const dpr_loss* loss, dpr_gradient** gradients,
                                   std::size_t count) {
  return guarded([&] {
    give_gradients(gradients, count, batch,
                   [&](dpr::SceneBatch& b) { return b.backward(deref(loss, "loss").loss); });
  });
}

dpr_status dpr_batch_backward_losses(dpr_batch* batch, const dpr_loss* loss,
                                     const dpr_mesh_loss* const* mesh_losses, dpr_gradient** gradients,
                                     std::size_t count) {
  return guarded([&] {
    give_gradients(gradients, count, batch, [&](dpr::SceneBatch& b) {
      deref(mesh_losses, "mesh_losses");
      std::vector<const dpr::MeshLoss*> own;
      for (const dpr_mesh_loss* of_scene : std::span(mesh_losses, count))
        own.push_back(of_scene ? &deref(of_scene, "mesh_losses").loss : nullptr);
      return b.backward(deref(loss, "loss").loss, own);
    });
  });
}

dpr_status dpr_batch_backward_pixels(dpr_batch* batch, const float* grad, std::size_t grad_count,
                                     dpr_gradient** gradients, std::size_t count) {
  return guarded([&] {
    give_gradients(gradients, count, batch, [&](dpr::SceneBatch& b) {
      return b.backward_pixels(to_pixels(grad, grad_count, "grad"));
    });
  });
}

dpr_status dpr_batch_backward_buffer(dpr_batch* batch, struct _cl_mem* grad, dpr_gradient** gradients,
                                     std::size_t count) {
  return guarded([&] {
    give_gradients(gradients, count, batch,
                   [&](dpr::SceneBatch& b) { return dpr::backward(b, &deref(grad, "grad")); });
  });
}

void dpr_batch_destroy(dpr_batch* batch) { destroy(batch); }
