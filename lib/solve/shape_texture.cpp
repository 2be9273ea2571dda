// The texture of a shape whose views are known.
#include <algorithm>
#include <cmath>

#include "dpr/multi_device.hpp"
#include "dpr/optimizer.hpp"
#include "dpr/shape.hpp"
#include "mesh/texture_atlas.hpp"
#include "scene/gradient_table.hpp"
#include "solve/shape_checks.hpp"
#include "solve/shape_level.hpp"
#include "solve/shape_space.hpp"

namespace dpr {

Mesh find_texture(std::vector<Device> devices, const ShapeViews& views, const Mesh& mesh, int side,
                  const std::function<bool(unsigned iteration, double loss)>& callback) {
  constexpr std::size_t k_views_at_once = 24;
  constexpr double k_first_rate = 0.05, k_last_rate = 2e-3, k_forgetting = 0.99;
  MultiDeviceRenderer renderer(std::move(devices));
  check_shape_views(views);
  validate(mesh, "mesh (texture)");
  ShapeOptions options;
  options.levels = 1;
  options.loss = LossWeights::only(LossKind::mse);
  options.depth = options.normal = 0;
  const ShapeLevel level(views, options, 0);
  const ShapeTargets targets(views, options, level);
  Scene scene;
  scene.width = level.width;
  scene.height = level.height;
  scene.background = views.background;
  scene.camera = level.views.front().camera;
  scene.meshes.push_back({with_atlas(mesh, side)});
  scene.lights = views.lights;
  scene.smoothing = finest_smoothing(views, options);
  scene.gradients = no_gradients();
  scene.gradients.texture = true;
  renderer.set_chunk(k_views_at_once);
  renderer.set_scene(scene);
  renderer.set_views(level.views);
  renderer.set_loss(targets.loss(), targets.images);
  Optimizer optimizer({.learning_rate = k_first_rate, .beta2 = k_forgetting});
  Mesh& textured = scene.meshes.front().mesh;
  std::vector<glm::vec3>& texels = textured.textures.front().texels;
  std::vector<double> slopes(3 * texels.size());
  for (unsigned i = 0; i < k_texture_iterations; ++i) {
    const MultiDeviceRenderer::Evaluation found = renderer.evaluate();
    if (callback && !callback(i, found.loss)) break;
    const std::vector<glm::vec3>& gradient = found.gradient.meshes.front().textures.front();
    for (std::size_t k = 0; k < slopes.size(); ++k)
      slopes[k] = static_cast<double>(gradient[k / 3][static_cast<int>(k % 3)]);
    optimizer.set_learning_rate(k_first_rate *
                                std::pow(k_last_rate / k_first_rate, double(i) / k_texture_iterations));
    const std::span<const double> step = optimizer.step(slopes);
    for (std::size_t k = 0; k < slopes.size(); ++k) {
      float& number = texels[k / 3][static_cast<int>(k % 3)];
      number = std::clamp(number + static_cast<float>(step[k]), 0.0F, 1.0F);
    }
    renderer.set_texels(0, 0, texels);
  }
  return std::move(textured);
}

}  // namespace dpr
