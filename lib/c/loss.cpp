// Losses of the C interface.
#include <algorithm>
#include <cstddef>

#include "c/handles.hpp"

using namespace dpr::c;

namespace dpr::c {
namespace {

/// Images of as many views as the caller says.
struct Targets {
  const float* values;
  std::size_t count, views;
  int width, height;
};

std::vector<Image> to_images(const float* values, const Targets& like) {
  std::vector<Image> images(like.views, Image(like.width, like.height));
  for (Image& image : images) {
    const std::size_t floats = image_floats(1, like.width, like.height);
    std::ranges::copy(to_pixels(values, floats, "targets"), image.pixels.begin());
    values += floats;
  }
  return images;
}

/// Masks of one channel.
std::vector<Image> to_masks(const float* values, const Targets& like) {
  std::vector<Image> masks;
  if (values) masks.assign(like.views, Image(like.width, like.height));
  for (Image& mask : masks) {
    for (glm::vec4& pixel : mask.pixels) pixel = glm::vec4(*values++);
  }
  return masks;
}

/// Weights in a program's version of the struct. The first version was padded to where robust begins.
LossWeights to_weights(const dpr_loss_weights* given) {
  const auto weights = versioned<dpr_loss_weights>(given, DPR_LOSS_WEIGHTS_INIT, "weights");
  LossWeights converted{.mse = weights.mse, .l1 = weights.l1, .silhouette = weights.silhouette};
  if (weights.size <= offsetof(dpr_loss_weights, robust_scale)) return converted;
  converted.robust = weights.robust;
  converted.robust_scale = weights.robust_scale;
  converted.ssim = weights.ssim;
  return converted;
}

/// Attributes that are compared beside colours; `images` holds them.
std::vector<AttributeTarget> to_attributes(const dpr_loss_options& options, const Targets& like,
                                           std::vector<std::vector<Image>>& images) {
  constexpr std::size_t k_most = 16;
  if (options.attribute_count > 0) deref(options.attributes, "options.attributes");
  if (options.attribute_count > k_most) {
    throw InvalidArgument("options.attribute_count", std::to_string(options.attribute_count),
                          "at most " + std::to_string(k_most));
  }
  std::vector<AttributeTarget> attributes;
  for (const dpr_attribute_target& given : std::span(options.attributes, options.attribute_count)) {
    images.push_back(to_images(&deref(given.targets, "options.attributes.targets"), like));
    const Attribute attribute = parse_attribute(&deref(given.name, "options.attributes.name"), "name");
    attributes.push_back({attribute, to_weights(given.weights), images.back()});
  }
  return attributes;
}

void give_loss(dpr_loss** loss, const dpr_device* device, const dpr_loss_options& options,
               const Targets& targets) {
  deref(loss, "loss");
  deref(device, "device");
  const LossWeights weights = options.weights ? to_weights(options.weights) : LossWeights();
  require_views(targets.views);
  require_size(targets.width, targets.height, "size (targets)");
  const std::size_t floats = image_floats(targets.views, targets.width, targets.height);
  require_count(numbers(targets.values, targets.count, 1, "targets").size(), floats, "targets");
  std::vector<std::vector<Image>> images;
  const std::vector<AttributeTarget> attributes = to_attributes(options, targets, images);
  const std::vector<Image> masks = to_masks(options.masks, targets);
  const std::span<const unsigned char> has_alpha(options.has_alpha, options.has_alpha ? targets.views : 0);
  give(loss, ImageLoss(device->device,
                       {.weights = weights,
                        .has_alpha = has_alpha,
                        .masks = masks,
                        .levels = options.levels,
                        .attributes = attributes},
                       to_images(targets.values, targets)));
}

}  // namespace
}  // namespace dpr::c

dpr_status dpr_loss_create(const dpr_device* device, const dpr_loss_weights* weights, const float* targets,
                           std::size_t count, std::size_t views, int width, int height, dpr_loss** loss) {
  return guarded([&] {
    deref(weights, "weights");
    dpr_loss_options options = DPR_LOSS_OPTIONS_INIT;
    options.weights = weights;
    give_loss(loss, device, options, {targets, count, views, width, height});
  });
}

dpr_status dpr_loss_create_with(const dpr_device* device, const dpr_loss_options* options,
                                const float* targets, std::size_t count, std::size_t views, int width,
                                int height, dpr_loss** loss) {
  return guarded([&] {
    give_loss(loss, device, versioned<dpr_loss_options>(options, DPR_LOSS_OPTIONS_INIT, "options"),
              {targets, count, views, width, height});
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
    *value = deref(loss, "loss").loss.evaluate(batch_of(batch));
  });
}

void dpr_loss_destroy(dpr_loss* loss) { destroy(loss); }

dpr_status dpr_mesh_loss_create(const dpr_device* device, const dpr_mesh_loss_weights* weights,
                                const dpr_mesh* mesh, dpr_mesh_loss** loss) {
  return guarded([&] {
    deref(loss, "loss");
    const auto w = versioned<dpr_mesh_loss_weights>(weights, DPR_MESH_LOSS_WEIGHTS_INIT, "weights");
    const dpr::Mesh shape = to_mesh(versioned<dpr_mesh>(mesh, DPR_MESH_INIT, "mesh"));
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

void dpr_mesh_loss_destroy(dpr_mesh_loss* loss) { destroy(loss); }
