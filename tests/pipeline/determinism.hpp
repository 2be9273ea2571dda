// Scenes of the tests of determinism, and the comparison of images and gradients bit by bit.
#pragma once

#include <cstring>
#include <vector>

#include "check/comparison.hpp"
#include "pipeline/scenes.hpp"
#include "support/reduced.hpp"

namespace dpr::test::pipeline {

/// Bit by bit: NaN equals itself, and 0 is not -0.
inline bool same_bits(const Image& a, const Image& b) {
  return a.pixels.size() == b.pixels.size() &&
         std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(glm::vec4)) == 0;
}

inline bool same_bits(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.empty() || a.size() != b.size()) return a.size() == b.size();  // memcmp takes no null pointers
  return std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

inline bool same_bits(const SceneGradient& a, const SceneGradient& b) {
  const std::vector<Block> blocks_a = blocks_of(a), blocks_b = blocks_of(b);
  bool same = blocks_a.size() == blocks_b.size();
  for (std::size_t i = 0; same && i < blocks_a.size(); ++i) {
    same = same_bits(blocks_a[i].found, blocks_b[i].found);
  }
  return same;
}

struct Result {
  Image image;
  SceneGradient gradient;
};

inline bool same_bits(const Result& a, const Result& b) {
  return same_bits(a.image, b.image) && same_bits(a.gradient, b.gradient);
}

inline Result render(Renderer& renderer) {
  renderer.forward();
  const Image grad = random_image(renderer.scene().width, renderer.scene().height, -1.0F, 1.0F);
  return {renderer.image(), renderer.backward(std::span(&grad, 1))};
}

inline Result render(const Device& device, const Scene& scene) {
  Renderer renderer(device);
  renderer.set_scene(scene);
  return render(renderer);
}

inline Scene test_scene() {
  const int size = reduced(40, 9);
  return scene_of(reduced(1, 0) == 1 ? make_icosphere(1, 1.3F) : make_cube(), size, size - 3);
}

inline Scene sampled_scene() {
  Scene scene = test_scene();
  scene.smoothing.occupancy_estimator = scene.smoothing.aggregation_estimator = Estimator::monte_carlo;
  return scene;
}

inline Scene sampled_joint_scene() {
  Scene scene = sampled_scene();
  scene.smoothing.composition = Composition::joint;
  scene.smoothing.variance_reduction = VarianceReduction::leave_one_out;
  scene.smoothing.draws = Draws::antithetic;
  return scene;
}

inline Scene joint_scene() {
  Scene scene = test_scene();
  scene.smoothing.composition = Composition::joint;
  scene.lights = every_light(Shading::phong);
  scene.gradients.lights = true;
  return scene;
}

}  // namespace dpr::test::pipeline
