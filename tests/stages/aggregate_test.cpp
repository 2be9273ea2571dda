// The exact barrier aggregation against the reference: weights, image and every gradient of synthetic pixels,
// from none to 300 fragments, from coincident to far apart, for each prior.
#include <doctest/doctest.h>

#include <array>

#include "support/aggregate_errors.hpp"

namespace aggregate_test {

namespace {

using dpr::Prior;
using dpr::Smoothing;
using dpr::test::AggregateErrors;
using dpr::test::compare_with_reference;
using dpr::test::SyntheticFrame;
using dpr::test::SyntheticPixel;

/// Tolerances, about twice the errors measured; what is measured says dpr::test::AggregateErrors.
struct PriorCase {
  Prior prior;
  std::string_view name;
  double weight, color, beta, gamma, alpha;  // beta: gradients of depth and ln p
};

/// Measured over four settings of gamma and alpha and up to 300 fragments, and what the weights should reach;
/// gradients ten times that:
///   prior     weight  colour  depth, ln p  gamma   alpha   wanted
///   gaussian  5.4e-7  3.8e-7  2.8e-5       2.8e-6  5.4e-6  5e-6
///   cauchy    1.3e-5  5.5e-6  2.4e-5       6.8e-6  7.0e-6  1e-4
///   logistic  2.5e-7  1.9e-7  7.2e-6       3.3e-5  2.7e-5  2e-5
///   gumbel    1.8e-7  2.1e-7  9.0e-6       2.6e-5  2.1e-6  2e-5
///   uniform   1.3e-7  6.3e-7  6.3e-6       8.5e-7  6.1e-7  2e-5
constexpr std::array<PriorCase, 5> k_cases{
    {{Prior::gaussian, "gaussian", 1.1e-6, 8e-7, 5e-5, 6e-6, 1.1e-5},
     {Prior::cauchy, "cauchy", 2.6e-5, 1.1e-5, 4.8e-5, 1.4e-5, 1.4e-5},
     {Prior::logistic, "logistic", 5.8e-7, 4e-7, 1.5e-5, 6.6e-5, 5.4e-5},
     {Prior::gumbel, "gumbel", 5.6e-7, 4.2e-7, 1.8e-5, 5.2e-5, 4.2e-6},
     {Prior::uniform, "uniform", 5e-7, 1.3e-6, 1.3e-5, 2e-6, 1.5e-6}}};
constexpr double k_alpha = 2.2e-7;  // of the image; measured 1.1e-7

struct Setting {
  float gamma, alpha;
};
constexpr std::array<Setting, 4> k_settings{{{1e-7F, 0.5F}, {1e-4F, 3.0F}, {1e-2F, 1.0F}, {1.0F, 0.5F}}};

Smoothing barrier(Prior prior, float gamma, float alpha) {
  Smoothing smoothing = dpr::smoothing_preset("gaussian");
  smoothing.depth_prior = prior;
  smoothing.gamma = gamma;
  smoothing.alpha = alpha;
  return smoothing;
}

AggregateErrors all_errors(Prior prior) {
  AggregateErrors errors;
  unsigned seed = 1;
  for (const Setting& s : k_settings) {
    compare_with_reference(dpr::test::make_pixels(s.gamma, seed++), barrier(prior, s.gamma, s.alpha), errors);
  }
  compare_with_reference(dpr::test::make_crowds(1e-2F, 99), barrier(prior, 1e-2F, 1), errors);
  return errors;
}

/// Two and three opaque fragments in any order, the gaps between their betas from none to beyond the reach.
std::vector<SyntheticPixel> make_triples(float gamma) {
  const std::vector<float> gaps{0, 0.05F, 0.4F, 1, 2, 3.3F, 5, 7, 8.5F, 8.7F, 30};
  const float unit = gamma * (dpr::test::k_zfar - dpr::test::k_znear);
  dpr::test::RandomFloat random(5);
  std::vector<SyntheticPixel> pixels;
  for (const float second : gaps) {
    for (const float third : gaps) {
      SyntheticPixel pixel;
      for (const float gap : {0.0F, second, third}) pixel.push_back({2 + gap * unit, 1, random.color()});
      pixels.push_back({pixel[0], pixel[1]});
      pixels.push_back({pixel[2], pixel[0], pixel[1]});
      pixels.push_back(std::move(pixel));
    }
  }
  if (dpr::test::is_reduced()) pixels.resize(12);
  return pixels;
}

bool passes(const AggregateErrors& e, const PriorCase& c) {
  return e.weight.error <= c.weight && e.color.error <= c.color && e.alpha.error <= k_alpha &&
         e.grad_depth.error <= c.beta && e.grad_log_occupancy.error <= c.beta &&
         e.grad_gamma.error <= c.gamma && e.grad_alpha.error <= c.alpha;
}

}  // namespace

TEST_SUITE("gradient") {
  TEST_CASE("barrier aggregation: weights, image and gradients are the reference's") {
    for (const PriorCase& c : k_cases) {
      CAPTURE(std::string(c.name));
      const AggregateErrors errors = all_errors(c.prior);
      DPR_CHECK_WORST(errors.weight, c.weight);
      DPR_CHECK_WORST(errors.color, c.color);
      DPR_CHECK_WORST(errors.alpha, k_alpha);
      DPR_CHECK_WORST(errors.grad_depth, c.beta);
      DPR_CHECK_WORST(errors.grad_log_occupancy, c.beta);
      DPR_CHECK_WORST(errors.grad_gamma, c.gamma);
      DPR_CHECK_WORST(errors.grad_alpha, c.alpha);
    }
  }

  TEST_CASE("barrier aggregation: results that are off by a few per cent are found out") {
    for (const PriorCase& c : k_cases) {
      CAPTURE(std::string(c.name));
      AggregateErrors good, bad;
      const std::vector<SyntheticPixel> pixels = dpr::test::make_pixels(1e-2F, 4);
      const std::vector<SyntheticPixel> few(pixels.begin(),
                                            pixels.begin() + (dpr::test::is_reduced() ? 8 : 45));
      compare_with_reference(few, barrier(c.prior, 1e-2F, 1), good);
      compare_with_reference(few, barrier(c.prior, 1e-2F, 1), bad, 1.03F);
      CHECK(passes(good, c));
      CHECK(bad.weight.error > c.weight);
      CHECK(bad.color.error > c.color);
      CHECK(bad.grad_depth.error > c.beta);
      CHECK(bad.grad_log_occupancy.error > c.beta);
      // A few pixels may have one slot each, and no gradient of gamma.
      if (!dpr::test::is_reduced()) CHECK(bad.grad_gamma.error > c.gamma);
      CHECK(bad.grad_alpha.error > c.alpha);
    }
  }

  // Measured: weights 1.2e-7, colours 1.3e-7, gradients 2.2e-6, of gamma 2e-6.
  TEST_CASE("barrier aggregation: two and three slots of Gaussian noise have closed forms") {
    constexpr double k_weight = 2.4e-7, k_color = 2.6e-7, k_beta = 4.4e-6, k_gamma = 4.4e-6;
    const auto errors_at = [&](float distortion) {
      AggregateErrors errors;
      compare_with_reference(make_triples(1e-2F), barrier(Prior::gaussian, 1e-2F, 1), errors, distortion);
      return errors;
    };
    const AggregateErrors errors = errors_at(1);
    DPR_CHECK_WORST(errors.weight, k_weight);
    DPR_CHECK_WORST(errors.color, k_color);
    DPR_CHECK_WORST(errors.grad_depth, k_beta);
    DPR_CHECK_WORST(errors.grad_log_occupancy, k_beta);
    DPR_CHECK_WORST(errors.grad_gamma, k_gamma);
    const AggregateErrors bad = errors_at(1.0001F);
    CHECK(bad.weight.error > k_weight);
    CHECK(bad.grad_depth.error > k_beta);
  }
}

TEST_SUITE("unit") {
  TEST_CASE(
      "barrier aggregation: a pixel without fragments shows the background, and gives it all of the "
      "gradient") {
    SyntheticFrame frame({{}, {{2.0F, 0.5F, glm::vec3(1, 0, 0)}}, {}});
    const auto image = frame.forward(barrier(Prior::gaussian, 1e-2F, 1), dpr::test::k_background);
    const std::vector<cl_float4> grad(3, cl_float4{{1, 2, 3, 4}});
    const SyntheticFrame::Gradients g = frame.backward(dpr::test::k_background, grad);
    for (const std::size_t i : {0U, 2U}) {
      CHECK(glm::vec3(image[i].s[0], image[i].s[1], image[i].s[2]) == dpr::test::k_background);
      CHECK(image[i].s[3] == 0.0F);
      CHECK(g.background[i] == glm::vec3(1, 2, 3));
      CHECK(g.gamma[i] == 0.0F);
      CHECK(g.alpha[i] == 0.0F);
    }
  }

  TEST_CASE("barrier aggregation: a fragment with p = 0 changes nothing and has no gradient") {
    for (const PriorCase& c : k_cases) {
      CAPTURE(std::string(c.name));
      const dpr::test::SyntheticFragment absent{1.5F, 0.0F, glm::vec3(0, 1, 0)},
          a{2.0F, 0.5F, glm::vec3(1, 0, 0)}, b{2.5F, 0.9F, glm::vec3(0, 0, 1)};
      SyntheticFrame frame({{a, b}, {absent, a, b}, {absent}});
      const auto image = frame.forward(barrier(c.prior, 1e-2F, 1), dpr::test::k_background);
      const std::vector<cl_float4> grad(3, cl_float4{{1, -2, 3, 4}});
      const SyntheticFrame::Gradients g = frame.backward(dpr::test::k_background, grad);
      for (std::size_t channel = 0; channel < 4; ++channel) {
        CHECK(std::abs(image[0].s[channel] - image[1].s[channel]) < 2e-6F);
      }
      CHECK(std::abs(image[2].s[0] - dpr::test::k_background.x) < 1e-6F);
      for (const std::size_t i : {1U, 2U}) {
        CHECK(g.depth[i][0] == 0.0F);
        CHECK(g.log_occupancy[i][0] == 0.0F);
        CHECK(g.red[i][0] == 0.0F);
      }
      CHECK(std::isfinite(g.gamma[2]));
      CHECK(g.alpha[2] == 0.0F);
    }
  }

  TEST_CASE("barrier aggregation: fragments beside each other and in any order give the same colour") {
    for (const PriorCase& c : k_cases) {
      CAPTURE(std::string(c.name));
      dpr::test::RandomFloat random(2);
      SyntheticPixel pixel = dpr::test::make_pixel(9, 4, 1e-2F, dpr::test::Occupancies::any, random);
      SyntheticPixel turned(pixel.rbegin(), pixel.rend());
      SyntheticFrame frame({pixel, turned});
      const auto image = frame.forward(barrier(c.prior, 1e-2F, 1), dpr::test::k_background);
      for (std::size_t channel = 0; channel < 4; ++channel) {
        CHECK(std::abs(image[0].s[channel] - image[1].s[channel]) < 1e-6F);
      }
    }
  }
}

}  // namespace aggregate_test
