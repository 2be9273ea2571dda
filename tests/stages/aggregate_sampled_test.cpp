// The sampled barrier aggregation against the exact expectations: image, gradients and sensitivities for each
// prior, baseline and way of drawing, within four standard errors that the samples themselves give. Every
// pixel draws its own noise, so that many equal pixels are many independent estimates.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <functional>

#include "support/aggregate_errors.hpp"
#include "support/estimates.hpp"
#include "support/synthetic_pixels.hpp"

namespace aggregate_sampled_test {

namespace {

namespace ref = dpr::reference;
using dpr::Draws;
using dpr::Prior;
using dpr::Smoothing;
using dpr::VarianceReduction;
using dpr::test::Estimate;
using dpr::test::k_sampled_priors;
using dpr::test::number;
using dpr::test::reduced;
using dpr::test::SamplingMode;
using dpr::test::SyntheticFragment;
using dpr::test::SyntheticFrame;
using dpr::test::SyntheticPixel;

constexpr SamplingMode k_plain{VarianceReduction::none, Draws::independent};
constexpr SamplingMode k_rigid{VarianceReduction::rigid, Draws::independent};

const std::vector<SyntheticFragment> k_fragments{{2.0F, 0.6F, glm::vec3(0.9F, 0.1F, 0.3F)},
                                                 {2.6F, 0.9F, glm::vec3(0.2F, 0.8F, 0.5F)},
                                                 {3.1F, 1.0F, glm::vec3(0.4F, 0.3F, 0.9F)},
                                                 {2.2F, 0.0F, glm::vec3(0.5F, 0.5F, 0.5F)}};
constexpr glm::vec3 k_background{0.7F, 0.2F, 0.1F};
constexpr cl_float4 k_grad{{0.8F, -0.5F, 0.6F, 0.4F}};

Smoothing sampled_aggregation(Prior prior, SamplingMode mode, std::uint32_t samples, std::uint64_t seed = 1) {
  Smoothing smoothing = dpr::smoothing_preset("gaussian");
  smoothing.depth_prior = prior;
  smoothing.aggregation_estimator = dpr::Estimator::monte_carlo;
  smoothing.gamma = 0.01F;  // 1 in depth: the fragments' noise overlaps
  smoothing.alpha = 0.8F;
  smoothing.background_depth = 0.97F;  // the background takes its share
  smoothing.samples = samples;
  smoothing.variance_reduction = mode.reduction;
  smoothing.draws = mode.draws;
  smoothing.seed = seed;
  validate(smoothing);
  return smoothing;
}

/// Equal pixels, rendered with their gradients.
struct AggregateSamples {
  explicit AggregateSamples(std::size_t pixels, const SyntheticPixel& pixel = k_fragments)
      : count(pixels), frame(std::vector<SyntheticPixel>(pixels, pixel)) {}
  void run(const Smoothing& smoothing) {
    image = frame.forward(smoothing, k_background);
    gradients = frame.backward(k_background, std::vector<cl_float4>(count, k_grad));
  }
  Estimate over_pixels(const std::function<double(std::size_t)>& value) const {
    return dpr::test::estimate_over(count, value);
  }
  Estimate by_gamma() const {
    return over_pixels([&](std::size_t i) { return number(gradients.gamma[i]); });
  }
  Estimate by_depth(std::size_t k) const {
    return over_pixels([&](std::size_t i) { return number(gradients.depth[i][k]); });
  }

  std::size_t count;
  SyntheticFrame frame;
  std::vector<cl_float4> image;
  SyntheticFrame::Gradients gradients;
};

std::size_t pixel_count() { return static_cast<std::size_t>(reduced(12000, 64)); }

bool same(const std::vector<cl_float4>& a, const std::vector<cl_float4>& b) {
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t c = 0; c < 4; ++c) {
      if (a[i].s[c] != b[i].s[c]) return false;
    }
  }
  return a.size() == b.size();
}

ref::AggregateGradient exact_gradient(const Smoothing& smoothing, const SyntheticPixel& pixel = k_fragments) {
  return ref::aggregate_backward(
      dpr::test::reference_fragments(pixel), dpr::test::reference_parameters(smoothing, k_background),
      {number(k_grad.s[0]), number(k_grad.s[1]), number(k_grad.s[2])}, number(k_grad.s[3]));
}

/// `slots` in all: fragments within a few gamma of each other, and the background among them.
SyntheticPixel crowd(int slots) {
  dpr::test::RandomFloat random(static_cast<unsigned>(slots));
  SyntheticPixel pixel;
  for (int k = 0; k + 1 < slots; ++k) {
    pixel.push_back({random(2.0F, 4.0F), random(0.2F, 1.0F), random.color()});
  }
  return pixel;
}

}  // namespace

TEST_SUITE("statistical") {
  TEST_CASE("sampled aggregation: image, weights and every gradient are unbiased, every mode") {
    AggregateSamples samples(pixel_count());
    for (const Prior prior : k_sampled_priors) {
      for (const SamplingMode& mode : dpr::test::sampling_modes(prior)) {
        const std::string name = std::string(to_string(prior)) + " " + mode.name();
        CAPTURE(name);
        const Smoothing smoothing = sampled_aggregation(prior, mode, 10);
        samples.run(smoothing);
        const ref::AggregateResult exact =
            ref::aggregate_forward(dpr::test::reference_fragments(k_fragments),
                                   dpr::test::reference_parameters(smoothing, k_background));
        const ref::AggregateGradient wanted = exact_gradient(smoothing);
        for (std::size_t channel = 0; channel < 3; ++channel) {
          DPR_CHECK_ESTIMATE(
              samples.over_pixels([&](std::size_t i) { return number(samples.image[i].s[channel]); }),
              exact.color[channel]);
        }
        for (std::size_t k = 0; k < k_fragments.size(); ++k) {
          CAPTURE(k);
          DPR_CHECK_ESTIMATE(samples.over_pixels([&](std::size_t i) {
            return number(samples.gradients.red[i][k]) / number(k_grad.s[0]);
          }),
                             exact.weights[k]);
          DPR_CHECK_ESTIMATE(samples.by_depth(k), wanted.fragments[k].depth);
          DPR_CHECK_ESTIMATE(samples.over_pixels([&](std::size_t i) {
            return number(samples.gradients.log_occupancy[i][k]);
          }),
                             wanted.fragments[k].log_occupancy +
                                 number(k_fragments[k].occupancy) * wanted.fragments[k].occupancy);
        }
        DPR_CHECK_ESTIMATE(samples.by_gamma(), wanted.gamma);
        DPR_CHECK_ESTIMATE(
            samples.over_pixels([&](std::size_t i) { return number(samples.gradients.alpha[i]); }),
            wanted.alpha);
        DPR_CHECK_ESTIMATE(
            samples.over_pixels([&](std::size_t i) { return number(samples.gradients.background[i].y); }),
            wanted.background.y);
        CHECK_FALSE(
            samples.by_gamma().agrees_with(wanted.gamma + 9 * samples.by_gamma().standard_error() + 1e-3));
        CHECK_FALSE(samples.by_depth(0).agrees_with(-wanted.fragments[0].depth));
      }
    }
  }

  TEST_CASE("sampled aggregation: the control variate reduces the variance where one fragment dominates") {
    const SyntheticPixel clear{{2.0F, 1.0F, glm::vec3(1.0F, 0.0F, 0.2F)},
                               {7.0F, 1.0F, glm::vec3(0.0F, 1.0F, 0.3F)}};
    AggregateSamples samples(pixel_count(), clear);
    for (const Prior prior : k_sampled_priors) {
      CAPTURE(to_string(prior));
      samples.run(sampled_aggregation(prior, k_plain, 8));
      const Estimate plain_depth = samples.by_depth(0), plain_gamma = samples.by_gamma();
      samples.run(sampled_aggregation(prior, k_rigid, 8));
      CHECK(samples.by_depth(0).variance() < 0.5 * plain_depth.variance());
      CHECK(samples.by_gamma().variance() < 0.5 * plain_gamma.variance());
    }
  }

  TEST_CASE("sampled aggregation: sensitivities of 2 to 50 slots, and what the constant -1 would give") {
    for (const int slots : {2, 3, 5, 8, 13, 21, 34, 50}) {
      if (dpr::test::is_reduced() && slots > 5) break;
      CAPTURE(slots);
      const SyntheticPixel pixel = crowd(slots);
      const Smoothing smoothing = sampled_aggregation(Prior::gaussian, k_rigid, 16);
      AggregateSamples samples(static_cast<std::size_t>(reduced(4000, 16)), pixel);
      samples.run(smoothing);
      const ref::AggregateGradient wanted = exact_gradient(smoothing, pixel);
      DPR_CHECK_ESTIMATE(samples.by_gamma(), wanted.gamma);
      DPR_CHECK_ESTIMATE(
          samples.over_pixels([&](std::size_t i) { return number(samples.gradients.alpha[i]); }),
          wanted.alpha);
      // With -1 for -d, eq. (58) and (66) as printed, (d - 1) / gamma times the mean excess would come on
      // top.
      Smoothing limit = smoothing;
      limit.gamma = 1e-7F;
      limit.alpha = smoothing.alpha * limit.gamma / smoothing.gamma;  // (gamma / alpha) ln p stays what it is
      const std::vector<cl_float4> rigid = samples.frame.forward(limit, k_background);
      const Estimate printed = samples.over_pixels([&](std::size_t i) {
        double excess = 0;
        for (std::size_t c = 0; c < 3; ++c) {
          excess += number(k_grad.s[c]) * (number(samples.image[i].s[c]) - number(rigid[i].s[c]));
        }
        return number(samples.gradients.gamma[i]) + (slots - 1) * excess / number(smoothing.gamma);
      });
      if (!dpr::test::is_reduced()) CHECK_FALSE(printed.agrees_with(wanted.gamma));
    }
  }
}

TEST_SUITE("unit") {
  TEST_CASE("sampled aggregation: the same seed gives the same bits, another seed does not") {
    for (const Prior prior : k_sampled_priors) {
      for (const SamplingMode& mode : dpr::test::sampling_modes(prior)) {
        CAPTURE(to_string(prior));
        CAPTURE(mode.name());
        AggregateSamples samples(64);
        samples.run(sampled_aggregation(prior, mode, 8, 5));
        const std::vector<cl_float4> image = samples.image;
        const std::vector<float> gamma = samples.gradients.gamma;
        samples.run(sampled_aggregation(prior, mode, 8, 6));
        CHECK_FALSE(same(samples.image, image));
        CHECK(samples.gradients.gamma != gamma);
        samples.run(sampled_aggregation(prior, mode, 8, 5));
        CHECK(same(samples.image, image));
        CHECK(samples.gradients.gamma == gamma);
      }
    }
  }

  TEST_CASE("sampled aggregation: the backward pass draws the forward pass' noise") {
    // The weights that the gradients of the colours carry are those of the image, to the last bit: both are
    // counts of winners over a power of two.
    const SyntheticPixel pixel{{2.0F, 1.0F, glm::vec3(1, 0, 0)}, {2.5F, 0.8F, glm::vec3(0, 1, 0)}};
    for (const Prior prior : k_sampled_priors) {
      CAPTURE(to_string(prior));
      AggregateSamples samples(64, pixel);
      Smoothing smoothing = sampled_aggregation(prior, k_rigid, 16);
      samples.image = samples.frame.forward(smoothing, glm::vec3(0, 0, 1));
      const cl_float4 ones{{1, 1, 1, 0}};
      samples.gradients = samples.frame.backward(glm::vec3(0, 0, 1), std::vector<cl_float4>(64, ones));
      std::size_t wrong = 0, mixed = 0;
      for (std::size_t i = 0; i < 64; ++i) {
        wrong += samples.gradients.red[i][0] != samples.image[i].s[0];
        wrong += samples.gradients.red[i][1] != samples.image[i].s[1];
        wrong += samples.gradients.background[i].x != samples.image[i].s[2];
        mixed += samples.image[i].s[0] > 0 && samples.image[i].s[1] > 0;
      }
      CHECK(wrong == 0);
      CHECK(mixed > 0);
      smoothing.seed = 77;  // the gradients of another seed are not those of the image
      samples.frame.forward(smoothing, glm::vec3(0, 0, 1));
      const auto other = samples.frame.backward(glm::vec3(0, 0, 1), std::vector<cl_float4>(64, ones));
      for (std::size_t i = 0; i < 64; ++i) wrong += other.red[i][0] != samples.image[i].s[0];
      CHECK(wrong > 0);
    }
  }

  TEST_CASE("sampled aggregation: the number of samples need not be a multiple of a block") {
    AggregateSamples pixels(8);
    for (const std::uint32_t count : {1U, 3U, 9U}) {
      for (const Draws draws : {Draws::independent, Draws::stratified}) {
        pixels.run(sampled_aggregation(Prior::gaussian, {VarianceReduction::none, draws}, count));
        for (const auto& weights : pixels.gradients.red) {
          const float wins = weights[0] / k_grad.s[0] * static_cast<float>(count);
          CHECK(std::abs(wins - std::round(wins)) < 1e-4F);
        }
      }
    }
  }
}

}  // namespace aggregate_sampled_test
