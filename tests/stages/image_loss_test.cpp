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
#include "solve/resample.hpp"
#include "support/messages.hpp"
#include "support/probe.hpp"
#include "support/reduced.hpp"

namespace image_loss_test {

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
    const dpr::LossWeights weights{.mse = 2, .l1 = 0.5F, .silhouette = 0.7F, .robust = 3};
    dpr::ImageLoss loss(dpr::test::test_device(), weights, targets, has_alpha);
    const double total = loss.evaluate(renderer);
    const std::vector<cl_float4> grad = impl_of(loss).grad_image().download();

    double expected = 0;
    for (std::size_t view = 0; view < k_views; ++view) {
      const auto image = to_reference(renderer.image(view)), target = to_reference(targets[view]);
      double value = 0;
      std::vector<double> expected_grad(image.rgba.size());
      for (const dpr::ImageLossRow& row : dpr::image_losses()) {
        if (row.name == "ssim") continue;  // of windows, not of pixels: ssim_test.cpp
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

namespace {

dpr::Image smaller(const dpr::Image& image) {
  return dpr::resample(image, image.width / 2, image.height / 2);
}

/// Means over pixels by their mask.
double masked_mse(const dpr::Image& image, const dpr::Image& target, const dpr::Image& mask) {
  double sum = 0, weights = 0;
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const glm::dvec3 difference(image.pixels[i] - target.pixels[i]);
    sum += static_cast<double>(mask.pixels[i].x) * glm::dot(difference, difference);
    weights += static_cast<double>(mask.pixels[i].x);
  }
  return sum / (3 * weights);
}

}  // namespace

TEST_SUITE("gradient") {
  TEST_CASE("masks and pyramids: values, and gradients by finite differences") {
    const dpr::Renderer renderer = render_cube();
    dpr::Image first = renderer.image(0);
    const int width = first.width, height = first.height;
    std::vector<dpr::Image> targets = make_targets(width, height), masks = targets;
    for (std::size_t i = 0; i < masks[1].pixels.size() / 2; ++i) masks[1].pixels[i].x = 0;
    const dpr::Device& device = renderer.device();
    dpr::ImageLoss masked(device, dpr::LossOptions{.weights = {.mse = 1}, .masks = masks}, targets);
    masked.evaluate(renderer);
    for (std::size_t view = 0; view < k_views; ++view) {
      CHECK(masked.per_view()[view] ==
            doctest::Approx(masked_mse(renderer.image(view), targets[view], masks[view])).epsilon(1e-5));
    }
    CHECK(impl_of(masked).grad_image().download()[targets[0].pixels.size()].s[0] == 0);

    dpr::ImageLoss loss(
        device,
        dpr::LossOptions{.weights = {.mse = 1, .silhouette = 1, .robust = 5, .robust_scale = 1},
                         .masks = masks,
                         .levels = 3},
        targets);
    loss.evaluate(renderer);
    const std::vector<cl_float4> grad = impl_of(loss).grad_image().download();
    const dpr::cl::Buffer buffer(dpr::image_handle(renderer), true);
    std::vector<cl_float4> pixels(grad.size());
    const auto& queue = impl_of(device).queue;
    REQUIRE(queue.enqueueReadBuffer(buffer, CL_TRUE, 0, pixels.size() * sizeof(cl_float4), pixels.data()) ==
            CL_SUCCESS);
    const auto loss_with = [&](std::size_t i, int channel, float step) {
      cl_float4 moved = pixels[i];
      moved.s[channel] += step;
      queue.enqueueWriteBuffer(buffer, CL_TRUE, i * sizeof(cl_float4), sizeof(cl_float4), &moved);
      const double value = loss.evaluate(renderer);
      queue.enqueueWriteBuffer(buffer, CL_TRUE, i * sizeof(cl_float4), sizeof(cl_float4), &pixels[i]);
      return value;
    };
    constexpr float k_step = 0.02F;
    double error = 0, size = 0;
    for (std::size_t i = 0; i < pixels.size(); i += 7) {
      for (int channel = 0; channel < 4; ++channel) {
        const double slope = (loss_with(i, channel, k_step) - loss_with(i, channel, -k_step)) /
                             (2 * static_cast<double>(k_step));
        const auto found = static_cast<double>(grad[i].s[channel]);
        error += (found - slope) * (found - slope);
        size += slope * slope;
      }
    }
    CHECK(error < 1e-6 * size);
  }

  TEST_CASE("pyramids: the mean over the levels") {
    dpr::Scene scene;
    scene.width = 16;
    scene.height = 8;
    scene.meshes.push_back({dpr::make_cube()});
    dpr::Renderer renderer(dpr::test::test_device());
    renderer.set_scene(scene);
    renderer.forward();
    const dpr::Image image = renderer.image(), target = make_targets(16, 8)[0];
    const auto evaluate = [&](unsigned levels) {
      dpr::ImageLoss loss(renderer.device(), dpr::LossOptions{.weights = {.mse = 1}, .levels = levels},
                          std::span(&target, 1));
      return loss.evaluate(renderer);
    };
    const auto mse = [&](const dpr::Image& a, const dpr::Image& b) {
      return dpr::reference::evaluate_loss("mse", to_reference(a), to_reference(b)).value;
    };
    const double fine = mse(image, target), coarse = mse(smaller(image), smaller(target));
    CHECK(evaluate(1) == doctest::Approx(fine).epsilon(1e-5));
    CHECK(evaluate(2) == doctest::Approx((fine + coarse) / 2).epsilon(1e-5));
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("masks, levels and scales that make no sense are refused") {
    const std::vector<dpr::Image> targets = make_targets(4, 4);
    const auto refuses = [&](const dpr::LossOptions& options, const char* part) {
      DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::ImageLoss(dpr::test::test_device(), options, targets),
                            part);
    };
    const std::vector<dpr::Image> black(k_views, dpr::Image(4, 4, glm::vec4(0))),
        negative(k_views, dpr::Image(4, 4, glm::vec4(-1))), large(k_views, dpr::Image(5, 4, glm::vec4(1)));
    refuses({.weights = {.mse = 1}, .masks = black}, "above 0");
    refuses({.weights = {.mse = 1}, .masks = negative}, "at least 0");
    refuses({.weights = {.mse = 1}, .masks = large}, "5x4");
    refuses({.weights = {.mse = 1}, .masks = std::span(targets).first(1)}, "1 images");
    refuses({.weights = {.mse = 1}, .levels = 0}, "levels");
    refuses({.weights = {.robust = 1, .robust_scale = 0}}, "robust_scale");
  }

  TEST_CASE("silhouettes that are almost nothing leave finite gradients") {
    const dpr::Renderer renderer = render_cube();
    const int width = renderer.scene().width, height = renderer.scene().height;
    const std::vector<dpr::Image> empty(k_views, dpr::Image(width, height, glm::vec4(0)));
    dpr::ImageLoss loss(renderer.device(), {.silhouette = 1}, empty);
    const dpr::Device::Impl& device = impl_of(renderer.device());
    const dpr::cl::Buffer image(dpr::image_handle(renderer), true);
    for (const float alpha : {0.0F, 1e-40F, 1e-25F, 1e-12F}) {
      CAPTURE(alpha);
      const std::vector<cl_float4> pixels(k_views * empty[0].pixels.size(), {{0, 0, 0, alpha}});
      REQUIRE(device.queue.enqueueWriteBuffer(image, CL_TRUE, 0, pixels.size() * sizeof(cl_float4),
                                              pixels.data()) == CL_SUCCESS);
      CHECK(std::isfinite(loss.evaluate(renderer)));
      for (const cl_float4& g : impl_of(loss).grad_image().download()) CHECK(std::isfinite(g.s[3]));
    }
  }

  TEST_CASE("one value of has_alpha a target, or none") {
    const std::vector<dpr::Image> targets = make_targets(4, 4);
    const std::array<unsigned char, 2> too_few{1, 0};
    CHECK_THROWS_AS(dpr::ImageLoss(dpr::test::test_device(), {.mse = 1}, targets, too_few),
                    dpr::InvalidArgument);
  }
}

}  // namespace image_loss_test
