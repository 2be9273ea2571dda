// The loss of what surfaces show in place of their colours.
#pragma once

#include "dpr/image_loss.hpp"
#include "kernels/attribute.hpp"

namespace dpr {

class AttributeLoss {
 public:
  AttributeLoss(const Device& device, const AttributeTarget& target, unsigned levels);

  /// The loss of the renderer's last images, one value a view.
  std::span<const double> evaluate(const Renderer& renderer);
  /// The gradient of the mean over the views, after evaluate(): the targets' views, or those of a batch that
  /// contains them.
  SceneGradient backward();
  void set_views_of_mean(std::size_t count);

 private:
  AttributeImages images_;
  ImageLoss loss_;                                     // of the differences: its targets are 0
  Buffer<cl_float4> target_, residual_, grad_images_;  // [view][height][width]
  Launcher<kernel::attribute_residual_forward, kernel::attribute_residual_backward> launch_;
};

/// Throws InvalidArgument unless the target can stand beside those of the images, one a view.
void check_attribute_target(const AttributeTarget& target, std::span<const Image> targets);

}  // namespace dpr
