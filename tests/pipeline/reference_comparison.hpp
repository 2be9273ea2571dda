// Images and gradients of whole frames against those of the reference.
#pragma once

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <string>

#include "check/comparison.hpp"
#include "dpr/renderer.hpp"
#include "pipeline/scenes.hpp"

namespace dpr::test::pipeline {

struct ImageError {
  double largest = 0, mean = 0;
};

/// Over all pixels but those where the image itself jumps.
inline ImageError image_error(const Image& found, const reference::Image& expected,
                              const Delicate& delicate) {
  ImageError error;
  for (std::size_t i = 0; i < expected.rgba.size(); ++i) {
    if (delicate.jump[i / 4]) continue;
    const double value = found.pixels[i / 4][static_cast<int>(i % 4)];
    const double difference = std::fabs(value - expected.rgba[i]);
    // Written so that NaN is the largest of all.
    if (!(difference <= error.largest)) error.largest = difference;
    error.mean += difference / static_cast<double>(expected.rgba.size());
  }
  return error;
}

/// A random derivative of the image, 0 where the image has a kink.
inline Image smooth_grad_image(const Scene& scene, const Delicate& delicate) {
  Image grad_image = random_image(scene.width, scene.height, -1.0F, 1.0F);
  for (std::size_t i = 0; i < grad_image.pixels.size(); ++i) {
    if (delicate.kink[i]) grad_image.pixels[i] = glm::vec4(0);
  }
  return grad_image;
}

/// Checks a scene's image, and its gradients for a random derivative of that, of which those that are called `block`
/// must have at least that norm. Returns how many are.
inline std::size_t check_opacities(const std::string& name, const Scene& scene, const std::string& block,
                                   double least_norm) {
  CAPTURE(name);
  const reference::Scene twin = to_reference(scene);
  const Delicate delicate = delicate_pixels(twin);
  Renderer renderer(open_device());
  renderer.set_scene(scene);
  renderer.forward();
  const double of_image = image_error(renderer.image(), reference::render(twin), delicate).largest;
  CHECK(of_image < 1e-4);
  const Image grad_image = smooth_grad_image(scene, delicate);
  const SceneGradient found = renderer.backward(std::span(&grad_image, 1));
  double worst = 0, of_opacities = 0;
  std::size_t count = 0;
  for (const Block& b : blocks_of(found, reference::gradient(twin, to_reference(grad_image)))) {
    CAPTURE(b.name);
    const double error = block_error(b, 1e-3);
    CHECK(error < 1e-3);
    worst = std::max(worst, error);
    if (b.name != block) continue;
    CHECK(norm(b.expected) > least_norm);
    of_opacities = std::max(of_opacities, error);
    ++count;
  }
  MESSAGE(name << ": image " << of_image << ", gradients " << worst << ", of " << block << " "
               << of_opacities);
  return count;
}

/// The scene in lights, whose gradients are asked for.
inline Scene lit(Scene scene) {
  scene.lights = two_lights(Shading::phong);
  scene.gradients.lights = true;
  return scene;
}

}  // namespace dpr::test::pipeline
