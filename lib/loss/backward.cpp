// The gradients of losses that were evaluated on a renderer's frame.
#include <cstdint>
#include <string>

#include "dpr/renderer.hpp"
#include "loss/image_loss_impl.hpp"
#include "loss/mesh_loss_impl.hpp"
#include "renderer/scene_batch_impl.hpp"

namespace dpr {
namespace {

/// Throws unless what was evaluated was the last frame.
void require_same_frame(std::uint64_t evaluated, std::uint64_t rendered, const char* what) {
  if (evaluated == rendered) return;
  throw InvalidArgument(std::string(what) + " (backward)", "the gradient of other images",
                        "a loss evaluated on this renderer's last forward()");
}

}  // namespace

std::vector<SceneGradient> SceneBatch::backward(const ImageLoss& loss) {
  impl_->require_forward("SceneBatch::backward");
  require_same_frame(loss.impl().frame_number, impl_->frame_number, "loss");
  return impl_->backward(loss.impl().grad_image());
}

SceneGradient Renderer::backward(const ImageLoss& loss) {
  impl_->require_forward("Renderer::backward");
  require_same_frame(loss.impl().frame_number, impl_->frame_number, "loss");
  SceneGradient gradient = impl_->backward(loss.impl().grad_image());
  loss.impl().add_attribute_gradients(gradient);
  return gradient;
}

SceneGradient Renderer::backward(const ImageLoss& loss, const MeshLoss& mesh_loss) {
  impl_->require_forward("Renderer::backward");
  require_same_frame(loss.impl().frame_number, impl_->frame_number, "loss");
  require_same_frame(mesh_loss.impl().frame_number, impl_->frame_number, "mesh_loss");
  if (!impl_->scene.gradients.positions) {
    throw InvalidArgument("mesh_loss (Renderer::backward)", "a scene without gradients of positions",
                          "GradientRequest::positions");
  }
  SceneGradient gradient = impl_->backward(loss.impl().grad_image(),
                                           [&](const Buffer<cl_float4>& positions, Buffer<cl_float4>& grad) {
                                             mesh_loss.impl().add_gradient(positions, grad);
                                           });
  loss.impl().add_attribute_gradients(gradient);
  return gradient;
}

}  // namespace dpr
