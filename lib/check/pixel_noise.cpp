// Self-test of noise on the pixel: contours, antialiasing and blur against an integral over the image plane.
#include <algorithm>
#include <functional>
#include <string>

#include "check/check_log.hpp"
#include "check/comparison.hpp"
#include "check/scenes.hpp"
#include "reference/pixel_noise.hpp"

namespace dpr::check {
namespace {

/// Largest difference of an image from the reference, for a blur of two pixels and 4x4 samples a pixel.
constexpr double k_blurred_image = 1.5e-3;
/// Largest relative difference of a directional derivative.
constexpr double k_blurred_gradient = 3e-3;

Scene blurred_cube() {
  Scene scene = scene_of(welded_cube(), 20, 16);
  std::vector<glm::vec3>& colors = scene.meshes[0].mesh.face_colors;
  std::ranges::fill(colors, colors[0]);  // the silhouette alone: where others end, samples are lost
  scene.smoothing = smoothing_preset("pixel", scene.width, scene.height);
  scene.smoothing.supersampling = 4;
  scene.smoothing.gamma = 1e-8F;
  const double scale = 2 * 2.0 / std::min(scene.width, scene.height);  // two pixels, NDC
  scene.smoothing.sigma = static_cast<float>(scale * scale);
  return scene;
}

/// A derivative of the image that changes over some pixels.
Image smooth_weights(int width, int height) {
  Image image(width, height);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const auto x = static_cast<float>(i % static_cast<std::size_t>(width)) / static_cast<float>(width);
    const auto y = static_cast<float>(i / static_cast<std::size_t>(width)) / static_cast<float>(height);
    image.pixels[i] = glm::vec4(std::cos(5 * x), std::sin(6 * y), std::cos(5 * x + 1), std::sin(6 * y - 1));
  }
  return image;
}

/// The reference's derivative of the weighed image along a way to move its scene.
double difference(const reference::Scene& twin, const reference::Image& weights, double step,
                  const std::function<void(reference::Scene&, double)>& move) {
  reference::Scene above = twin, below = twin;
  move(above, step);
  move(below, -step);
  return (reference::pixel_noise_objective(above, weights) -
          reference::pixel_noise_objective(below, weights)) /
         (2 * step);
}

}  // namespace

void check_pixel_noise(const Device& device, CheckLog& log) {
  const Scene scene = blurred_cube();
  Renderer renderer(device);
  renderer.set_scene(scene);
  renderer.forward();
  const Image image = renderer.image();
  reference::Scene twin = to_reference(scene);
  twin.smoothing.gamma = 0;  // opaque
  const reference::Image expected = reference::render_pixel_noise(twin);
  Largest worst;
  for (std::size_t i = 0; i < expected.rgba.size(); ++i)
    worst.add(static_cast<double>(image.pixels[i / 4][static_cast<int>(i % 4)]), expected.rgba[i]);
  log.add("contour, antialias, blur", "image of noise on the pixel, RGBA", worst.value(), k_blurred_image);

  const Image grad_image = smooth_weights(scene.width, scene.height);
  const reference::Image weights = to_reference(grad_image);
  const SceneGradient found = renderer.backward(std::span(&grad_image, 1));
  const glm::dvec3& translation = found.views[0].transforms[0].translation;
  Largest worst_gradient;
  for (std::size_t k = 0; k < 3; ++k) {
    const double derivative = difference(
        twin, weights, 1e-3, [k](reference::Scene& s, double t) { s.meshes[0].transform[k][3] += t; });
    worst_gradient.add((translation[static_cast<int>(k)] - derivative) / glm::length(translation));
  }
  const auto sigma = static_cast<double>(scene.smoothing.sigma);
  const double by_sigma =
      difference(twin, weights, 1e-3 * sigma, [](reference::Scene& s, double t) { s.smoothing.sigma += t; });
  worst_gradient.add(found.sigma / by_sigma, 1);
  log.add("contour, antialias, blur, backward", "gradients of translation and sigma, relative",
          worst_gradient.value(), k_blurred_gradient);
}

}  // namespace dpr::check
