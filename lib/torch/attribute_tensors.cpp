#include "torch/attribute_tensors.hpp"

#include <ATen/Functions.h>

#include <algorithm>
#include <vector>

#include "torch/tensor_rows.hpp"

namespace dpr::torch_op {
namespace {

Wanted wanted_of(Attribute attribute, const Wanted& wanted) {
  Wanted result;
  result.vertices = wanted.vertices;
  result.views = wanted.views;
  result.intrinsics = wanted.intrinsics;
  result.smoothing = wanted.smoothing;
  result.surface.texcoords = wanted.surface.texcoords && attribute == Attribute::texcoords;
  return result;
}

}  // namespace

at::Tensor render_attribute(Frame& frame, Attribute attribute, const Wanted& wanted) {
  Renderer& renderer = frame.renderer();
  renderer.set_gradients(request_of(wanted_of(attribute, wanted), ViewMotion::rigid));
  AttributeImages& images = frame.attribute_images(attribute);
  images.forward(renderer);
  const Scene& scene = renderer.scene();
  const auto views = static_cast<std::int64_t>(renderer.views().size());
  at::Tensor tensor = at::empty({views, scene.height, scene.width, 4}, at::kFloat);
  auto* next = reinterpret_cast<glm::vec4*>(tensor.data_ptr<float>());
  for (std::size_t v = 0; v < renderer.views().size(); ++v)
    next = std::ranges::copy(images.image(v).pixels, next).out;
  return tensor;
}

Gradients backward_attribute(Frame& frame, Attribute attribute, const at::Tensor& grad_images,
                             const at::Tensor& vertices, const at::Tensor& views, const Wanted& wanted) {
  const Renderer& renderer = frame.renderer();
  const at::Tensor contiguous = grad_images.contiguous();
  auto pixels = rows<glm::vec4>(contiguous);
  std::vector<Image> images;
  for (std::size_t v = 0; v < renderer.views().size(); ++v) {
    Image& image = images.emplace_back(renderer.scene().width, renderer.scene().height);
    std::ranges::copy(pixels.first(image.pixels.size()), image.pixels.begin());
    pixels = pixels.subspan(image.pixels.size());
  }
  SceneGradient gradient = frame.attribute_images(attribute).backward(images);
  return gather_gradients(renderer, gradient, vertices, views, wanted_of(attribute, wanted),
                          ViewMotion::rigid);
}

}  // namespace dpr::torch_op
