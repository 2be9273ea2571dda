// Losses of a batch of images and their gradients against the reference: means over the views (75), (76), and
// targets without a silhouette.
#include <doctest/doctest.h>

#include <array>
#include <cmath>

#include "device/context.hpp"
#include "dpr/error.hpp"
#include "dpr/image_loss.hpp"
#include "dpr/opencl_handles.hpp"
#include "dpr/renderer.hpp"
#include "loss/image_loss_impl.hpp"
#include "reference/loss.hpp"
#include "support/probe.hpp"
#include "support/reduced.hpp"

namespace {

constexpr std::size_t k_views = 3;

dpr::Renderer render_cube() {
  dpr::Scene scene;
  scene.smoothing = dpr::smoothing_preset("gaussian");
  scene.width = dpr::test::reduced(14, 6);
  scene.height = dpr::test::reduced(10, 5);
  scene.background = glm::vec3(0.1F, 0.3F, 0.2F);
  scene.meshes.push_back({dpr::make_cube()});
  scene.smoothing.sigma = 1e-2F;
  dpr::Renderer renderer(dpr::test::test_device());
  renderer.set_scene(scene);
  std::vector<dpr::View> views;
  for (const float azimuth : {10.0F, 130.0F, 220.0F})
    views.push_back({dpr::orbit_camera(5, 20, azimuth), {glm::mat4(1.0F)}});
  renderer.set_views(views);
  renderer.forward();
  return renderer;
}

std::vector<dpr::Image> make_targets(int width, int height) {
  std::vector<dpr::Image> targets(k_views, dpr::Image(width, height));
  for (std::size_t view = 0; view < k_views; ++view) {
    for (std::size_t i = 0; i < targets[view].pixels.size(); ++i) {
      const auto t = static_cast<float>(i + 3 * view);
      targets[view].pixels[i] = 0.5F + 0.5F * glm::sin(t * glm::vec4(0.3F, 0.5F, 0.7F, 0.4F));
    }
  }
  return targets;
}

dpr::reference::Image to_reference(const dpr::Image& image) {
  dpr::reference::Image result = dpr::reference::make_image(image.width, image.height);
  for (std::size_t i = 0; i < result.rgba.size(); ++i)
    result.rgba[i] = static_cast<double>(image.pixels[i / 4][static_cast<int>(i % 4)]);
  return result;
}

}  // namespace

TEST_SUITE("gradient") {
  TEST_CASE("losses of three views, the second without a silhouette, and their gradients") {
    const dpr::Renderer renderer = render_cube();
    const std::vector<dpr::Image> targets = make_targets(renderer.scene().width, renderer.scene().height);
    const std::array<unsigned char, k_views> has_alpha{1, 0, 1};
    const dpr::LossWeights weights{.mse = 2, .l1 = 0.5F, .silhouette = 0.7F};
    dpr::ImageLoss loss(dpr::test::test_device(), weights, targets, has_alpha);
    const double total = loss.evaluate(renderer);
    const std::vector<cl_float4> grad = loss.impl().grad_image.download();

    double expected = 0;
    for (std::size_t view = 0; view < k_views; ++view) {
      const auto image = to_reference(renderer.image(view)), target = to_reference(targets[view]);
      double value = 0;
      std::vector<double> expected_grad(image.rgba.size());
      for (const dpr::ImageLossRow& row : dpr::image_losses()) {
        const auto reference = dpr::reference::evaluate_loss(row.name, image, target);
        const double weight =
            row.reads_alpha && has_alpha[view] == 0 ? 0.0 : static_cast<double>(weights.*row.weight);
        REQUIRE((weight > 0 || row.reads_alpha));
        value += weight * reference.value;
        for (std::size_t i = 0; i < expected_grad.size(); ++i)
          expected_grad[i] += weight * reference.grad_image.rgba[i] / k_views;
      }
      CHECK(loss.per_view()[view] == doctest::Approx(value).epsilon(1e-6));
      expected += value / k_views;
      for (std::size_t i = 0; i < expected_grad.size(); ++i) {
        const double g = expected_grad[i];
        const float found = grad[view * image.rgba.size() / 4 + i / 4].s[i % 4];
        CHECK(std::fabs(static_cast<double>(found) - g) < 1e-8 + 2e-6 * std::fabs(g));
      }
    }
    CHECK(total == doctest::Approx(expected).epsilon(1e-6));
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("silhouettes that are almost nothing leave finite gradients") {
    const dpr::Renderer renderer = render_cube();
    const int width = renderer.scene().width, height = renderer.scene().height;
    const std::vector<dpr::Image> empty(k_views, dpr::Image(width, height, glm::vec4(0)));
    dpr::ImageLoss loss(renderer.device(), {.silhouette = 1}, empty);
    const dpr::Device::Impl& device = renderer.device().impl();
    const dpr::cl::Buffer image(dpr::image_handle(renderer), true);
    for (const float alpha : {0.0F, 1e-40F, 1e-25F, 1e-12F}) {
      CAPTURE(alpha);
      const std::vector<cl_float4> pixels(k_views * empty[0].pixels.size(), {{0, 0, 0, alpha}});
      REQUIRE(device.queue.enqueueWriteBuffer(image, CL_TRUE, 0, pixels.size() * sizeof(cl_float4),
                                              pixels.data()) == CL_SUCCESS);
      CHECK(std::isfinite(loss.evaluate(renderer)));
      for (const cl_float4& g : loss.impl().grad_image.download()) CHECK(std::isfinite(g.s[3]));
    }
  }

  TEST_CASE("one value of has_alpha a target, or none") {
    const std::vector<dpr::Image> targets = make_targets(4, 4);
    const std::array<unsigned char, 2> too_few{1, 0};
    CHECK_THROWS_AS(dpr::ImageLoss(dpr::test::test_device(), {.mse = 1}, targets, too_few),
                    dpr::InvalidArgument);
  }
}
