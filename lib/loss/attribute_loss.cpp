#include "loss/attribute_loss.hpp"

#include <string>

#include "base/checks.hpp"
#include "loss/image_loss_impl.hpp"
#include "renderer/attribute_images_impl.hpp"

namespace dpr {
namespace {

/// A loss of differences: of pixels that count by the alpha of the targets.
ImageLoss loss_of_differences(const Device& device, const AttributeTarget& target, unsigned levels) {
  std::vector<Image> zeros, masks;
  for (const Image& image : target.targets) {
    zeros.emplace_back(image.width, image.height);
    masks.emplace_back(image.width, image.height);
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
      masks.back().pixels[i] = glm::vec4(image.pixels[i].w);
  }
  return {device, LossOptions{.weights = target.weights, .masks = masks, .levels = levels}, zeros};
}

}  // namespace

void check_attribute_target(const AttributeTarget& target, std::span<const Image> targets) {
  const std::string name = "targets (" + std::string(to_string(target.attribute)) + ")";
  if (target.weights.silhouette != 0 || target.weights.ssim != 0) {
    throw InvalidArgument("weights (loss of " + std::string(to_string(target.attribute)) + ")",
                          "a weight of silhouette or ssim", "0 for both: they say nothing of differences");
  }
  if (target.targets.size() != targets.size()) {
    throw InvalidArgument(name, std::to_string(target.targets.size()) + " images",
                          "one for each of the " + std::to_string(targets.size()) + " views");
  }
  for (const Image& image : target.targets) {
    if (image.width != targets[0].width || image.height != targets[0].height) {
      throw InvalidArgument("size of the " + name, checks::size(image.width, image.height),
                            checks::size(targets[0].width, targets[0].height));
    }
    checks::require_pixels(image, name);
  }
}

AttributeLoss::AttributeLoss(const Device& device, const AttributeTarget& target, unsigned levels)
    : images_(device, target.attribute),
      loss_(loss_of_differences(device, target, levels)),
      launch_(impl_of(device)) {
  std::vector<cl_float4> pixels;
  for (const Image& image : target.targets) {
    for (const glm::vec4& p : image.pixels) pixels.push_back({{p.x, p.y, p.z, 0}});
  }
  target_.upload(impl_of(device), pixels);
  residual_.resize(impl_of(device), pixels.size());
  grad_images_.resize(impl_of(device), pixels.size());
}

std::span<const double> AttributeLoss::evaluate(const Renderer& renderer) {
  images_.forward(renderer);
  const std::size_t pixels = target_.size();
  launch_(pixels, kernel::attribute_residual_forward{.pixels = static_cast<cl_uint>(pixels),
                                                     .images = impl_of(images_).images(),
                                                     .target = target_,
                                                     .residual = residual_});
  impl_of(loss_).evaluate(residual_);
  return loss_.per_view();
}

void AttributeLoss::set_views_of_mean(std::size_t count) { impl_of(loss_).set_views_of_mean(count); }

SceneGradient AttributeLoss::backward() {
  const std::size_t pixels = target_.size();
  launch_(pixels, kernel::attribute_residual_backward{.pixels = static_cast<cl_uint>(pixels),
                                                      .target = target_,
                                                      .grad_residual = impl_of(loss_).grad_image(),
                                                      .grad_images = grad_images_});
  return impl_of(images_).backward(grad_images_);
}

}  // namespace dpr
