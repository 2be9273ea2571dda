// The exact joint aggregation against the reference: weights, image and every gradient of synthetic pixels,
// from none to 300 fragments, from coincident to far apart, for each prior it serves; and the sorting it
// begins with.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>

#include "support/aggregate_errors.hpp"

namespace aggregate_joint_test {

namespace {

using dpr::Prior;
using dpr::Smoothing;
using dpr::test::AggregateErrors;
using dpr::test::compare_with_reference;
using dpr::test::reduced;
using dpr::test::SyntheticFragment;
using dpr::test::SyntheticFrame;
using dpr::test::SyntheticPixel;

/// Tolerances, about twice the errors measured; what is measured says dpr::test::AggregateErrors.
struct PriorCase {
  Prior prior;
  std::string_view name;
  double weight, color, depth, log_occupancy, gamma;
};

/// Measured over gamma 1e-7, 1e-2 and 1, and up to 300 fragments:
///   prior     weight  colour  depth   ln p    gamma   wanted for the weights
///   gaussian  6.5e-7  3.5e-7  3.8e-5  2.0e-5  1.3e-6  5e-6
///   cauchy    3.1e-6  3.9e-6  1.1e-5  4.5e-5  6.9e-6  1e-4
///   logistic  1.4e-6  2.0e-7  2.4e-6  2.5e-5  1.1e-6  2e-5
///   gumbel    9.3e-7  1.5e-7  2.4e-6  2.4e-5  2.3e-5  2e-5
///   uniform   9.2e-8  5.8e-7  2.5e-6  1.5e-6  9.8e-7  2e-5
constexpr std::array<PriorCase, 5> k_cases{{{Prior::gaussian, "gaussian", 2.4e-6, 8.4e-7, 5e-5, 5e-5, 1e-5},
                                            {Prior::cauchy, "cauchy", 2e-5, 1e-5, 4e-5, 9e-5, 2e-5},
                                            {Prior::logistic, "logistic", 3.6e-6, 5e-7, 1e-5, 6e-5, 1e-5},
                                            {Prior::gumbel, "gumbel", 1.9e-6, 4e-7, 1e-5, 5e-5, 4.6e-5},
                                            {Prior::uniform, "uniform", 5e-7, 1.2e-6, 1e-5, 1e-5, 5e-6}}};
constexpr double k_alpha = 2e-7;  // of the image; measured 9.5e-8

Smoothing joint(Prior prior, float gamma) {
  Smoothing smoothing = dpr::smoothing_preset("gaussian");
  smoothing.depth_prior = prior;
  smoothing.gamma = gamma;
  smoothing.composition = dpr::Composition::joint;
  return smoothing;
}

AggregateErrors all_errors(Prior prior) {
  AggregateErrors errors;
  unsigned seed = 21;
  for (const float gamma : {1e-7F, 1e-2F, 1.0F}) {
    compare_with_reference(dpr::test::make_pixels(gamma, seed++), joint(prior, gamma), errors);
  }
  return errors;
}

/// Pixels of 300 fragments, whose errors are larger: each fragment leaves out a little of its mass.
AggregateErrors crowd_errors(Prior prior) {
  AggregateErrors errors;
  compare_with_reference(dpr::test::make_crowds(1e-2F, 98), joint(prior, 1e-2F), errors);
  return errors;
}

void check_within(const AggregateErrors& errors, const PriorCase& c) {
  DPR_CHECK_WORST(errors.weight, c.weight);
  DPR_CHECK_WORST(errors.color, c.color);
  DPR_CHECK_WORST(errors.alpha, k_alpha);
  DPR_CHECK_WORST(errors.grad_depth, c.depth);
  DPR_CHECK_WORST(errors.grad_log_occupancy, c.log_occupancy);
  DPR_CHECK_WORST(errors.grad_gamma, c.gamma);
}

}  // namespace

TEST_SUITE("gradient") {
  TEST_CASE("joint aggregation: weights, image and gradients are the reference's") {
    for (const PriorCase& c : k_cases) {
      CAPTURE(std::string(c.name));
      const AggregateErrors errors = all_errors(c.prior);
      check_within(errors, c);
      CHECK(errors.grad_alpha.error == 0.0);
    }
  }

  TEST_CASE("joint aggregation: 300 fragments in a pixel") {
    for (const PriorCase& c : k_cases) {
      CAPTURE(std::string(c.name));
      const AggregateErrors errors = crowd_errors(c.prior);
      check_within(errors, c);
    }
  }

  TEST_CASE("joint aggregation: results that are off by a few per cent are found out") {
    for (const PriorCase& c : k_cases) {
      CAPTURE(std::string(c.name));
      AggregateErrors bad;
      const std::vector<SyntheticPixel> pixels = dpr::test::make_pixels(1e-2F, 4);
      const std::vector<SyntheticPixel> few(pixels.begin(),
                                            pixels.begin() + (dpr::test::is_reduced() ? 8 : 24));
      compare_with_reference(few, joint(c.prior, 1e-2F), bad, 1.03F);
      CHECK(bad.weight.error > c.weight);
      CHECK(bad.color.error > c.color);
      CHECK(bad.alpha.error > k_alpha);
      CHECK(bad.grad_depth.error > c.depth);
      CHECK(bad.grad_log_occupancy.error > c.log_occupancy);
      CHECK(bad.grad_gamma.error > c.gamma);
    }
  }
}

TEST_SUITE("unit") {
  TEST_CASE("joint aggregation: fragments in any order give the same image, bit by bit") {
    dpr::test::RandomFloat random(3);
    // Registers hold 8; up to 64 are counted, more are in heaps.
    for (const int count : {2, 3, 8, 9, reduced(17, 10), reduced(64, 11), 65, reduced(300, 66)}) {
      SyntheticPixel pixel = dpr::test::make_pixel(count, 50, 1e-2F, dpr::test::Occupancies::any, random);
      std::ranges::sort(pixel, {}, &SyntheticFragment::depth);
      SyntheticPixel turned(pixel.rbegin(), pixel.rend()), mixed(pixel);
      for (std::size_t i = 0; i < mixed.size(); i += 2) std::swap(mixed[i], mixed[mixed.size() - 1 - i]);
      SyntheticFrame frame({pixel, turned, mixed});
      const auto image = frame.forward(joint(Prior::gaussian, 1e-2F), dpr::test::k_background);
      for (std::size_t channel = 0; channel < 4; ++channel) {
        CHECK(image[0].s[channel] == image[1].s[channel]);
        CHECK(image[0].s[channel] == image[2].s[channel]);
      }
    }
  }

  TEST_CASE("exact aggregation: a second backward pass finds the same, bit by bit") {
    const std::vector<SyntheticPixel> pixels = dpr::test::make_pixels(1e-2F, 12);
    const std::vector<cl_float4> grad_image = dpr::test::make_grad_image(pixels.size(), 5);
    for (const dpr::Composition composition : {dpr::Composition::barrier, dpr::Composition::joint}) {
      Smoothing smoothing = joint(Prior::gaussian, 1e-2F);
      smoothing.composition = composition;
      SyntheticFrame frame(pixels);
      frame.forward(smoothing, dpr::test::k_background);
      const SyntheticFrame::Gradients first = frame.backward(dpr::test::k_background, grad_image);
      const SyntheticFrame::Gradients second = frame.backward(dpr::test::k_background, grad_image);
      CHECK(first.depth == second.depth);
      CHECK(first.log_occupancy == second.log_occupancy);
      CHECK(first.red == second.red);
      CHECK(first.gamma == second.gamma);
    }
  }

  TEST_CASE("joint aggregation: far apart it is front-to-back compositing, colour and alpha agree") {
    const SyntheticFragment front{2.0F, 0.25F, glm::vec3(1, 0, 0)}, back{50.0F, 0.5F, glm::vec3(0, 1, 0)};
    SyntheticFrame frame({{back, front}, {front}, {}});
    const auto image = frame.forward(joint(Prior::gaussian, 1e-4F), glm::vec3(0, 0, 1));
    const float tolerance = 1e-6F;
    CHECK(std::abs(image[0].s[0] - 0.25F) < tolerance);
    CHECK(std::abs(image[0].s[1] - 0.375F) < tolerance);
    CHECK(std::abs(image[0].s[2] - 0.375F) < tolerance);
    CHECK(std::abs(image[0].s[3] - 0.625F) < tolerance);
    CHECK(std::abs(image[1].s[0] - 0.25F) < tolerance);
    CHECK(image[2].s[2] == 1.0F);
    CHECK(image[2].s[3] == 0.0F);
  }

  TEST_CASE("joint aggregation: what an opaque fragment hides has no weight and no gradient") {
    const SyntheticFragment front{2.0F, 1.0F, glm::vec3(1, 0, 0)}, back{50.0F, 0.5F, glm::vec3(0, 1, 0)};
    SyntheticFrame frame({{back, front}});
    frame.forward(joint(Prior::gaussian, 1e-3F), dpr::test::k_background);
    const SyntheticFrame::Gradients g = frame.backward(dpr::test::k_background, {{{1, 1, 1, 1}}});
    CHECK(g.green[0][0] == 0.0F);
    CHECK(g.depth[0][0] == 0.0F);
    CHECK(g.log_occupancy[0][0] == 0.0F);
    CHECK(std::abs(g.red[0][1] - 1.0F) < 1e-6F);
  }

  TEST_CASE("exact aggregation: no NaN or infinity, whatever the fragments, in either composition") {
    for (const dpr::Composition composition : {dpr::Composition::barrier, dpr::Composition::joint}) {
      for (const PriorCase& c : k_cases) {
        CAPTURE(std::string(c.name));
        std::vector<SyntheticPixel> pixels;
        for (const int count : {0, 1, 2, reduced(300, 12)}) {
          for (const float p : {0.0F, 0.5F, 1.0F}) {
            for (const float spread : {0.0F, 1e-3F}) {
              SyntheticPixel pixel;
              for (int k = 0; k < count; ++k)
                pixel.push_back({2.0F + spread * static_cast<float>(k), p, glm::vec3(0.5F)});
              pixels.push_back(pixel);
            }
          }
        }
        const std::vector<cl_float4> grad_image = dpr::test::make_grad_image(pixels.size(), 5);
        for (const float gamma : {1e-9F, 1e-7F, 1e-2F, 1.0F}) {
          Smoothing smoothing = joint(c.prior, gamma);
          smoothing.composition = composition;
          SyntheticFrame frame(pixels);
          bool finite = true;
          for (const cl_float4& value : frame.forward(smoothing, dpr::test::k_background)) {
            for (const float v : value.s) finite = finite && std::isfinite(v);
          }
          const SyntheticFrame::Gradients g = frame.backward(dpr::test::k_background, grad_image);
          for (const auto* rows : {&g.depth, &g.log_occupancy, &g.red, &g.green, &g.blue}) {
            for (const auto& row : *rows) {
              for (const float v : row) finite = finite && std::isfinite(v);
            }
          }
          for (const auto* values : {&g.gamma, &g.alpha}) {
            for (const float v : *values) finite = finite && std::isfinite(v);
          }
          CAPTURE(gamma);
          CHECK(finite);
        }
      }
    }
  }
}

}  // namespace aggregate_joint_test
