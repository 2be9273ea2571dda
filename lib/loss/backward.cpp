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

/// Throws unless the loss can add to the gradient of the renderer's last frame.
AddToGradient checked_gradient(const MeshLoss& mesh_loss, const Renderer::Impl& renderer) {
  require_same_frame(impl_of(mesh_loss).frame_number, renderer.frame_number, "mesh_loss");
  if (!renderer.scene.gradients.positions) {
    throw InvalidArgument("mesh_loss (backward)", "a scene without gradients of positions",
                          "GradientRequest::positions");
  }
  return [&loss = impl_of(mesh_loss)](const Buffer<cl_float4>& positions, Buffer<cl_float4>& grad) {
    loss.add_gradient(positions, grad);
  };
}

}  // namespace

std::vector<SceneGradient> SceneBatch::backward(const ImageLoss& loss) { return backward(loss, {}); }

std::vector<SceneGradient> SceneBatch::backward(const ImageLoss& loss,
                                                std::span<const MeshLoss* const> mesh_losses) {
  impl_->require_forward("SceneBatch::backward");
  require_same_frame(impl_of(loss).frame_number, impl_->frame_number, "loss");
  if (!mesh_losses.empty() && mesh_losses.size() != scenes()) {
    throw InvalidArgument("mesh_losses (SceneBatch::backward)", std::to_string(mesh_losses.size()),
                          "one for each of the " + std::to_string(scenes()) + " scenes");
  }
  std::vector<AddToGradient> add_to_positions;
  for (std::size_t i = 0; i < mesh_losses.size(); ++i) {
    const MeshLoss* const own = mesh_losses[i];
    add_to_positions.push_back(own ? checked_gradient(*own, impl_of(impl_->renderers[i])) : AddToGradient());
  }
  return impl_->backward(impl_of(loss).grad_image(), add_to_positions);
}

SceneGradient Renderer::backward(const ImageLoss& loss) {
  impl_->require_forward("Renderer::backward");
  require_same_frame(impl_of(loss).frame_number, impl_->frame_number, "loss");
  SceneGradient gradient = impl_->backward(impl_of(loss).grad_image());
  impl_of(loss).add_attribute_gradients(gradient);
  return gradient;
}

SceneGradient Renderer::backward(const ImageLoss& loss, const MeshLoss& mesh_loss) {
  impl_->require_forward("Renderer::backward");
  require_same_frame(impl_of(loss).frame_number, impl_->frame_number, "loss");
  SceneGradient gradient = impl_->backward(impl_of(loss).grad_image(), checked_gradient(mesh_loss, *impl_));
  impl_of(loss).add_attribute_gradients(gradient);
  return gradient;
}

}  // namespace dpr
