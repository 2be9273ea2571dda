// Losses of the C interface.
#include <algorithm>
#include <cstddef>

#include "c/handles.hpp"

using dpr::c::deref;
using dpr::c::give;
using dpr::c::guarded;
using dpr::c::renderer_of;

namespace dpr::c {
namespace {

std::vector<Image> to_images(std::span<const glm::vec4> pixels, std::size_t views, int width, int height) {
  std::vector<Image> images(views, Image(width, height));
  const std::size_t size = images.front().pixels.size();
  for (std::size_t v = 0; v < views; ++v)
    std::ranges::copy(pixels.subspan(v * size, size), images[v].pixels.begin());
  return images;
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

dpr_status dpr_loss_create(const dpr_device* device, const dpr_loss_weights* weights, const float* targets,
                           std::size_t count, std::size_t views, int width, int height, dpr_loss** loss) {
  return guarded([&] {
    deref(loss, "loss");
    deref(device, "device");
    const dpr::LossWeights wanted = dpr::c::to_weights(weights);
    dpr::c::require_views(views);
    dpr::c::require_size(width, height, "size (targets)");
    const std::span<const glm::vec4> pixels = dpr::c::to_pixels(targets, count, "targets");
    dpr::c::require_count(count, dpr::c::image_floats(views, width, height), "targets");
    give(loss, dpr::ImageLoss(device->device, wanted, dpr::c::to_images(pixels, views, width, height)));
  });
}

dpr_status dpr_loss_evaluate(dpr_loss* loss, const dpr_renderer* renderer, double* value) {
  return guarded([&] {
    deref(value, "value");
    *value = deref(loss, "loss").loss.evaluate(renderer_of(renderer));
  });
}

dpr_status dpr_loss_evaluate_batch(dpr_loss* loss, const dpr_batch* batch, double* value) {
  return guarded([&] {
    deref(value, "value");
    *value = deref(loss, "loss").loss.evaluate(dpr::c::batch_of(batch));
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
    *value = deref(loss, "loss").loss.evaluate(renderer_of(renderer), mesh);
  });
}

void dpr_mesh_loss_destroy(dpr_mesh_loss* loss) { delete loss; }
