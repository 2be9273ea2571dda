// Self-test of the sampled stages: the mean of many samples is the exact expectation but for an error that
// falls with their number. The draws are the same on every device, and so is that error, but for rounding.
#include <string>

#include "check/check_log.hpp"
#include "check/comparison.hpp"
#include "check/fragments.hpp"
#include "check/scenes.hpp"

namespace dpr::check {
namespace {

constexpr std::uint32_t k_samples = 4096;
/// Largest error of a mean of k_samples values of 0 or 1: five standard errors, for the worst of many pixels.
constexpr double k_mean_of_samples = 0.04;
/// Largest error relative to the gradient's norm. The score has heavier tails.
constexpr double k_sampled_gradient = 0.1;

Scene sampled_scene(Composition composition) {
  Scene scene = cube_scene(12, 12);
  scene.smoothing.composition = composition;
  scene.smoothing.gamma = 5e-2F;  // some gammas between the cube's sides: each wins some samples
  scene.smoothing.samples = k_samples;
  return scene;
}

void log_sampled_occupancy(const Device& device, CheckLog& log) {
  Scene scene = sampled_scene(Composition::barrier);
  Renderer exact(device), sampled(device);
  exact.set_scene(scene);
  exact.forward();
  scene.smoothing.occupancy_estimator = Estimator::monte_carlo;
  sampled.set_scene(scene);
  sampled.forward();
  exact.image();  // both frames are known to be complete
  sampled.image();
  const auto occupancy = [](const Renderer& renderer) {
    return impl_of(renderer).rasterize.plane(impl_of(renderer).frame, DPR_PLANE_OCCUPANCY);
  };
  const std::vector<float> expected = occupancy(exact), found = occupancy(sampled);
  Largest worst;
  if (found.size() != expected.size() || found.empty()) worst.add(INFINITY);
  for (std::size_t i = 0; i < std::min(found.size(), expected.size()); ++i)
    worst.add(static_cast<double>(found[i]), static_cast<double>(expected[i]));
  log.add("occupancy, sampled", "p of 4096 samples, exact p", worst.value(), k_mean_of_samples);
}

void log_sampled_image(const Device& device, CheckLog& log, Composition composition) {
  Scene scene = sampled_scene(composition);
  const reference::Scene twin = to_reference(scene);
  const Image grad_image(scene.width, scene.height, glm::vec4(0.3F, -0.2F, 0.4F, 0.1F));
  scene.smoothing.aggregation_estimator = Estimator::monte_carlo;
  if (composition == Composition::joint) scene.smoothing.occupancy_estimator = Estimator::monte_carlo;
  Renderer renderer(device);
  renderer.set_scene(scene);
  renderer.forward();
  const Image image = renderer.image();
  const reference::Image expected = reference::render(twin);
  Largest worst;
  for (std::size_t i = 0; i < expected.rgba.size(); ++i)
    worst.add(static_cast<double>(image.pixels[i / 4][static_cast<int>(i % 4)]), expected.rgba[i]);
  const std::string name = "aggregate, sampled", which = std::string(to_string(composition)) + ": ";
  log.add(name, which + "image of 4096 samples", worst.value(), k_mean_of_samples);
  Largest worst_gradient;
  for (const Block& block : blocks_of(renderer.backward(std::span(&grad_image, 1)),
                                      reference::gradient(twin, to_reference(grad_image)))) {
    if (block.name == "translation" || block.name == "colors")
      worst_gradient.add(block_error(block, k_sampled_gradient));
  }
  log.add(name + ", backward", which + "gradients of 4096 samples, relative", worst_gradient.value(),
          k_sampled_gradient);
}

}  // namespace

void check_sampling(const Device& device, CheckLog& log) {
  log_sampled_occupancy(device, log);
  log_sampled_image(device, log, Composition::barrier);
  log_sampled_image(device, log, Composition::joint);
}

}  // namespace dpr::check
