// Structural similarity against the reference and scikit-image's numbers, its gradient against differences of
// the reference; masks and pyramids.
#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "dpr/error.hpp"
#include "dpr/image_loss.hpp"
#include "loss/image_loss_impl.hpp"
#include "reference/ssim.hpp"
#include "support/messages.hpp"
#include "support/probe.hpp"
#include "support/reduced.hpp"

namespace ssim_test {

using namespace dpr;

namespace {

/// A pattern of smooth and rough parts, in [0, 1]; scikit-image's numbers below are of this one, rounded to
/// single precision.
Image pattern(int width, int height, double phase) {
  Image image(width, height, glm::vec4(1));
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      for (int channel = 0; channel < 3; ++channel) {
        const double smooth = std::sin(0.37 * column + 0.21 * row + phase + channel),
                     rough = std::cos(1.9 * column * (1 + channel) - 2.3 * row + 2 * phase);
        image.at(column, row)[channel] = static_cast<float>(0.5 + 0.3 * smooth + 0.2 * phase * rough);
      }
    }
  }
  return image;
}

reference::Image to_reference(const Image& image) {
  reference::Image result = reference::make_image(image.width, image.height);
  for (std::size_t i = 0; i < result.rgba.size(); ++i)
    result.rgba[i] = static_cast<double>(image.pixels[i / 4][static_cast<int>(i % 4)]);
  return result;
}

/// A loss of images without a renderer.
struct Evaluated {
  std::vector<double> per_view;
  std::vector<cl_float4> grad;
};

Evaluated evaluate(const LossOptions& options, std::span<const Image> images,
                   std::span<const Image> targets) {
  const Device device = test::test_device();
  std::vector<cl_float4> pixels;
  for (const Image& image : images) {
    for (const glm::vec4& p : image.pixels) pixels.push_back({{p.x, p.y, p.z, p.w}});
  }
  const Buffer<cl_float4> buffer(impl_of(device), pixels);
  ImageLoss loss(device, options, targets);
  impl_of(loss).evaluate(buffer);
  return {impl_of(loss).per_view, impl_of(loss).grad_image().download()};
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("ssim: what scikit-image has") {
    // skimage.metrics.structural_similarity(a, b, gaussian_weights=True, sigma=1.5,
    //                                       use_sample_covariance=False, data_range=1, channel_axis=2)
    struct Row {
      int width, height;
      double phase, expected;
    };
    for (const Row& row :
         {Row{11, 11, 0.1, 1.000000000}, Row{11, 13, 0.6, 0.668499647}, Row{24, 17, 0.3, 0.935899734},
          Row{24, 17, 0.9, 0.393002866}, Row{40, 33, 1, 0.302978378}}) {
      CAPTURE(row.phase);
      const Image image = pattern(row.width, row.height, row.phase),
                  target = pattern(row.width, row.height, 0.1);
      const Evaluated found = evaluate({.weights = {.ssim = 1}}, std::span(&image, 1), std::span(&target, 1));
      CHECK(1 - found.per_view[0] == doctest::Approx(row.expected).epsilon(1e-5));
      CHECK(reference::mean_ssim(to_reference(image), to_reference(target),
                                 to_reference(Image(row.width, row.height, glm::vec4(1)))) ==
            doctest::Approx(row.expected).epsilon(1e-6));
    }
  }

  TEST_CASE("ssim: equal images are alike") {
    const Image image = pattern(13, 12, 0.4);
    const Evaluated found = evaluate({.weights = {.ssim = 3}}, std::span(&image, 1), std::span(&image, 1));
    CHECK(std::abs(found.per_view[0]) < 1e-5);
    for (const cl_float4& g : found.grad) CHECK(std::abs(g.s[0]) + std::abs(g.s[1]) < 1e-4F);
  }
}

TEST_SUITE("gradient") {
  TEST_CASE("ssim: views, weights and masks, and the gradient by differences of the reference") {
    const int width = test::reduced(19, 12), height = test::reduced(17, 13);
    const std::vector<Image> images{pattern(width, height, 0.9), pattern(width, height, 0.5)},
        targets{pattern(width, height, 0.2), pattern(width, height, 0.1)};
    std::vector<Image> masks(2, Image(width, height, glm::vec4(1)));
    for (std::size_t i = 0; i < masks[1].pixels.size(); ++i)
      masks[1].pixels[i] = glm::vec4(i % 3 == 0 ? 0.0F : 0.5F);
    const Evaluated found = evaluate({.weights = {.ssim = 2}, .masks = masks}, images, targets);
    const std::size_t pixels = images[0].pixels.size();
    for (std::size_t view = 0; view < 2; ++view) {
      const reference::Image target = to_reference(targets[view]), mask = to_reference(masks[view]);
      reference::Image image = to_reference(images[view]);
      CHECK(found.per_view[view] ==
            doctest::Approx(2 * (1 - reference::mean_ssim(image, target, mask))).epsilon(1e-5));
      constexpr double k_step = 1e-5;
      double error = 0, size = 0;
      for (std::size_t i = 0; i < image.rgba.size(); i += 5) {
        const double value = image.rgba[i];
        image.rgba[i] = value + k_step;
        const double more = reference::mean_ssim(image, target, mask);
        image.rgba[i] = value - k_step;
        const double less = reference::mean_ssim(image, target, mask);
        image.rgba[i] = value;
        // The loss is the mean over two views.
        const double expected = -2 * (more - less) / (2 * k_step) / 2;
        const auto got = static_cast<double>(found.grad[view * pixels + i / 4].s[i % 4]);
        error += (got - expected) * (got - expected);
        size += expected * expected;
      }
      CHECK(std::sqrt(error / size) < 1e-4);
      CHECK(size > 0);
    }
  }

  TEST_CASE("ssim: levels of a pyramid, beside other losses, and the same bits again") {
    const std::vector<Image> images{pattern(24, 23, 0.9)}, targets{pattern(24, 23, 0.2)};
    const auto with = [&](const LossWeights& weights, unsigned levels) {
      return evaluate({.weights = weights, .levels = levels}, images, targets);
    };
    const Evaluated one = with({.ssim = 1}, 1), two = with({.ssim = 1}, 2), mse = with({.mse = 1}, 2),
                    both = with({.mse = 1, .ssim = 1}, 2);
    CHECK(both.per_view[0] == doctest::Approx(two.per_view[0] + mse.per_view[0]).epsilon(1e-6));
    CHECK(two.per_view[0] != one.per_view[0]);
    const Evaluated again = with({.mse = 1, .ssim = 1}, 2);
    for (std::size_t i = 0; i < both.grad.size(); ++i) {
      for (int c = 0; c < 4; ++c) {
        CHECK(both.grad[i].s[c] == doctest::Approx(two.grad[i].s[c] + mse.grad[i].s[c]).epsilon(1e-4));
        CHECK(both.grad[i].s[c] == again.grad[i].s[c]);
      }
    }
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("ssim: images without a window are refused") {
    const Image small(20, 10), enough(21, 21, glm::vec4(1)), rim = [] {
      Image mask(21, 21, glm::vec4(0));
      mask.at(4, 10) = glm::vec4(1);
      return mask;
    }();
    const auto refuses = [&](const LossOptions& options, const Image& target, const char* part) {
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, ImageLoss(test::test_device(), options, std::span(&target, 1)),
                            part);
    };
    refuses({.weights = {.ssim = 1}}, small, "size (ssim): got 20x10, expected 11x11");
    refuses({.weights = {.ssim = 1}, .levels = 3}, enough, "size (ssim): got 6x6");
    refuses({.weights = {.ssim = 1}, .masks = std::span(&rim, 1)}, enough, "mask (ssim)");
    CHECK(parse_loss("ssim", "loss") == LossKind::ssim);
    CHECK(LossWeights::only(LossKind::ssim).ssim == 1);
  }
}

}  // namespace ssim_test
