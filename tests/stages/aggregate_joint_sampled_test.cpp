// The sampled joint composition against the exact one: image, alpha, every gradient and both sensitivities
// for each prior with a score, baseline and way of drawing, within four standard errors that the samples
// themselves give.
#include <doctest/doctest.h>

#include <cmath>

#include "reference/occupancy.hpp"
#include "support/aggregate_errors.hpp"
#include "support/estimates.hpp"
#include "support/synthetic_pixels.hpp"

namespace aggregate_joint_sampled_test {

namespace {

namespace ref = dpr::reference;
using dpr::Draws;
using dpr::Prior;
using dpr::Smoothing;
using dpr::VarianceReduction;
using dpr::test::Estimate;
using dpr::test::estimate_over;
using dpr::test::k_sampled_priors;
using dpr::test::number;
using dpr::test::reduced;
using dpr::test::SamplingMode;
using dpr::test::SyntheticFrame;
using dpr::test::SyntheticPixel;

constexpr float k_sigma = 0.01F;
constexpr glm::vec3 k_background{0.7F, 0.2F, 0.1F};
constexpr cl_float4 k_grad{{0.8F, -0.5F, 0.6F, 0.4F}};
constexpr SamplingMode k_rigid{VarianceReduction::rigid, Draws::independent};

/// Distances in units of sigma.
SyntheticPixel make_pixel(const std::vector<std::pair<float, float>>& depths_and_distances) {
  dpr::test::RandomFloat random(11);
  SyntheticPixel pixel;
  for (const auto& [depth, x] : depths_and_distances)
    pixel.push_back({depth, 0, random.color(), x * k_sigma});
  return pixel;
}

/// Depths within a gamma or two, 1 apart being one; on either side of their edges, one far inside, one far
/// outside. The background shows in fewer than one sample in a thousand; the reduced number of pixels needs
/// it more often to tell a standard error.
const SyntheticPixel k_pixel =
    dpr::test::is_reduced()
        ? make_pixel({{2.4F, -0.3F}, {2.0F, -0.8F}, {3.1F, 0.4F}, {2.2F, -30.0F}})
        : make_pixel({{2.4F, 0.3F}, {2.0F, -0.8F}, {3.1F, 1.1F}, {2.9F, 9.0F}, {2.2F, -30.0F}, {2.7F, 0.0F}});

Smoothing sampled_joint(Prior occupancy, Prior depth, SamplingMode mode, std::uint32_t samples,
                        std::uint64_t seed = 1) {
  Smoothing smoothing = dpr::smoothing_preset("gaussian");
  smoothing.composition = dpr::Composition::joint;
  smoothing.occupancy_prior = occupancy;
  smoothing.depth_prior = depth;
  smoothing.occupancy_estimator = smoothing.aggregation_estimator = dpr::Estimator::monte_carlo;
  smoothing.sigma = k_sigma;
  smoothing.gamma = 0.01F;
  smoothing.samples = samples;
  smoothing.variance_reduction = mode.reduction;
  smoothing.draws = mode.draws;
  smoothing.seed = seed;
  validate(smoothing);
  return smoothing;
}

/// Equal pixels, rendered with their gradients.
struct JointSamples {
  JointSamples(std::size_t pixels, const SyntheticPixel& pixel)
      : count(pixels), frame(std::vector<SyntheticPixel>(pixels, pixel)) {}
  void run(const Smoothing& smoothing) {
    image = frame.forward(smoothing, k_background);
    gradients = frame.backward(k_background, std::vector<cl_float4>(count, k_grad));
  }
  Estimate channel(std::size_t c) const {
    return estimate_over(count, [&](std::size_t i) { return number(image[i].s[c]); });
  }
  static Estimate of(const std::vector<std::vector<float>>& values, std::size_t k) {
    return estimate_over(values.size(), [&](std::size_t i) { return number(values[i][k]); });
  }
  static Estimate of(const std::vector<float>& values) {
    return estimate_over(values.size(), [&](std::size_t i) { return number(values[i]); });
  }

  std::size_t count;
  SyntheticFrame frame;
  std::vector<cl_float4> image;
  SyntheticFrame::Gradients gradients;
};

/// Result of the exact composition: occupancies from the distances, and the chain rule back to distances.
struct Exact {
  Exact(const SyntheticPixel& pixel, const Smoothing& smoothing) {
    const auto prior = static_cast<ref::Prior>(smoothing.occupancy_prior);
    std::vector<ref::FragmentInput> fragments = dpr::test::reference_fragments(pixel);
    std::vector<double> xs;
    for (std::size_t k = 0; k < pixel.size(); ++k) {
      xs.push_back(number(pixel[k].distance) / number(smoothing.sigma));
      fragments[k].occupancy = ref::survival(prior, -xs[k]);
    }
    const ref::AggregateParameters p = dpr::test::reference_parameters(smoothing, k_background);
    result = ref::aggregate_forward(fragments, p);
    grad = ref::aggregate_backward(
        fragments, p, {number(k_grad.s[0]), number(k_grad.s[1]), number(k_grad.s[2])}, number(k_grad.s[3]));
    for (std::size_t k = 0; k < pixel.size(); ++k) {
      distance.push_back(grad.fragments[k].occupancy * ref::density(prior, -xs[k]) / number(smoothing.sigma));
      sigma -= xs[k] * distance[k];
    }
  }
  ref::AggregateResult result;
  ref::AggregateGradient grad;
  std::vector<double> distance;
  double sigma = 0;
};

std::size_t pixel_count() { return static_cast<std::size_t>(reduced(6000, 64)); }

void check_against_exact(const JointSamples& samples, const Exact& exact) {
  for (std::size_t c = 0; c < 3; ++c) DPR_CHECK_ESTIMATE(samples.channel(c), exact.result.color[c]);
  DPR_CHECK_ESTIMATE(samples.channel(3), exact.result.silhouette);
  const SyntheticFrame::Gradients& g = samples.gradients;
  for (std::size_t k = 0; k < exact.distance.size(); ++k) {
    CAPTURE(k);
    DPR_CHECK_ESTIMATE(JointSamples::of(g.red, k), exact.grad.fragments[k].color.x);
    DPR_CHECK_ESTIMATE(JointSamples::of(g.green, k), exact.grad.fragments[k].color.y);
    DPR_CHECK_ESTIMATE(JointSamples::of(g.blue, k), exact.grad.fragments[k].color.z);
    DPR_CHECK_ESTIMATE(JointSamples::of(g.depth, k), exact.grad.fragments[k].depth);
    DPR_CHECK_ESTIMATE(JointSamples::of(g.distance, k), exact.distance[k]);
  }
  DPR_CHECK_ESTIMATE(JointSamples::of(g.sigma), exact.sigma);
  DPR_CHECK_ESTIMATE(JointSamples::of(g.gamma), exact.grad.gamma);
  DPR_CHECK_ESTIMATE(estimate_over(samples.count, [&](std::size_t i) { return number(g.background[i].x); }),
                     exact.grad.background.x);
}

}  // namespace

TEST_SUITE("statistical") {
  TEST_CASE("sampled joint: image, alpha and every gradient are unbiased, every prior and mode") {
    JointSamples samples(pixel_count(), k_pixel);
    for (const Prior prior : k_sampled_priors) {
      for (const SamplingMode& mode : dpr::test::sampling_modes(prior)) {
        const std::string name = std::string(to_string(prior)) + " " + mode.name();
        CAPTURE(name);
        const Smoothing smoothing = sampled_joint(prior, prior, mode, 10);
        samples.run(smoothing);
        check_against_exact(samples, Exact(k_pixel, smoothing));
      }
    }
  }

  TEST_CASE("sampled joint: the two priors are chosen freely") {
    JointSamples samples(pixel_count(), k_pixel);
    for (std::size_t i = 0; i < k_sampled_priors.size(); ++i) {
      const Prior occupancy = k_sampled_priors[i],
                  depth = k_sampled_priors[(i + 1) % k_sampled_priors.size()];
      CAPTURE(to_string(occupancy));
      CAPTURE(to_string(depth));
      const Smoothing smoothing = sampled_joint(occupancy, depth, k_rigid, 10);
      samples.run(smoothing);
      check_against_exact(samples, Exact(k_pixel, smoothing));
    }
  }

  TEST_CASE("sampled joint: what is wrong is refused") {
    JointSamples samples(pixel_count(), k_pixel);
    const Smoothing smoothing = sampled_joint(Prior::gaussian, Prior::gaussian, k_rigid, 128);
    samples.run(smoothing);
    Smoothing other = smoothing;
    other.depth_prior = Prior::gumbel;
    const Exact exact(k_pixel, smoothing), wrong(k_pixel, other);
    if (dpr::test::is_reduced()) return;
    CHECK_FALSE(samples.channel(0).agrees_with(wrong.result.color.x));
    for (const double factor : {-1.0, 2.0}) {
      CAPTURE(factor);
      const SyntheticFrame::Gradients& g = samples.gradients;
      CHECK_FALSE(JointSamples::of(g.distance, 0).agrees_with(factor * exact.distance[0]));
      CHECK_FALSE(JointSamples::of(g.depth, 0).agrees_with(factor * exact.grad.fragments[0].depth));
      CHECK_FALSE(JointSamples::of(g.sigma).agrees_with(factor * exact.sigma));
      CHECK_FALSE(JointSamples::of(g.gamma).agrees_with(factor * exact.grad.gamma));
    }
  }

  TEST_CASE("sampled joint: sensitivities of 2 to 50 fragments") {
    for (const int count : {2, 3, 5, 8, 13, 21, 34, 50}) {
      if (dpr::test::is_reduced() && count > 5) break;
      CAPTURE(count);
      dpr::test::RandomFloat random(static_cast<unsigned>(count));
      std::vector<std::pair<float, float>> fragments;
      for (int k = 0; k < count; ++k) {
        const float depth = random(2.0F, 4.0F);
        fragments.emplace_back(depth, random(-3.0F, 1.0F));
      }
      const SyntheticPixel pixel = make_pixel(fragments);
      const Smoothing smoothing = sampled_joint(Prior::gaussian, Prior::gaussian, k_rigid, 16);
      JointSamples samples(static_cast<std::size_t>(reduced(2000, 16)), pixel);
      samples.run(smoothing);
      const Exact exact(pixel, smoothing);
      DPR_CHECK_ESTIMATE(samples.channel(3), exact.result.silhouette);
      DPR_CHECK_ESTIMATE(JointSamples::of(samples.gradients.sigma), exact.sigma);
      DPR_CHECK_ESTIMATE(JointSamples::of(samples.gradients.gamma), exact.grad.gamma);
    }
  }
}

TEST_SUITE("unit") {
  TEST_CASE("sampled joint: the same seed gives the same bits, another seed does not") {
    JointSamples samples(64, k_pixel);
    const auto run = [&](std::uint64_t seed) {
      samples.run(sampled_joint(Prior::gaussian, Prior::logistic, k_rigid, 8, seed));
      return samples.gradients.distance;
    };
    const auto first = run(5), other = run(6), again = run(5);
    CHECK(first == again);
    CHECK(first != other);
  }

  TEST_CASE("sampled joint: every sample is a rigid image") {
    const SyntheticPixel pixel{{2.0F, 0, glm::vec3(1, 0, 0), 0.0F},
                               {2.5F, 0, glm::vec3(0, 1, 0), 0.2F * k_sigma}};
    for (const std::uint32_t count : {1U, 3U, 8U, 13U}) {
      CAPTURE(count);
      SyntheticFrame frame(std::vector<SyntheticPixel>(64, pixel));
      const Smoothing smoothing = sampled_joint(Prior::gaussian, Prior::gaussian, k_rigid, count);
      const std::vector<cl_float4> image = frame.forward(smoothing, glm::vec3(0, 0, 1));
      const auto gradients = frame.backward(glm::vec3(0, 0, 1), std::vector<cl_float4>(64, {{1, 1, 1, 0}}));
      std::size_t mixed = 0;
      for (std::size_t i = 0; i < image.size(); ++i) {
        const auto& [red, green, blue, alpha] = image[i].s;
        const float wins = red * static_cast<float>(count);
        CHECK(std::abs(wins - std::round(wins)) < 1e-5F);
        CHECK(red + green == doctest::Approx(alpha));
        CHECK(red + green + blue == doctest::Approx(1));
        // The backward pass draws the same samples: its weights are those of the image.
        CHECK(gradients.red[i][0] == red);
        CHECK(gradients.red[i][1] == green);
        mixed += red > 0 && blue > 0;
      }
      CHECK((mixed > 0) == (count > 1));
    }
  }

  TEST_CASE("sampled joint: pixels without fragments, coincident depths, distances of zero and of any size") {
    const std::vector<SyntheticPixel> pixels{
        {},
        make_pixel({{2.0F, 0.0F}}),
        make_pixel({{2.0F, 0.0F}, {2.0F, 0.0F}, {2.0F, 0.0F}}),
        make_pixel({{2.0F, 1e30F}, {2.0F, -1e30F}}),
        SyntheticPixel(static_cast<std::size_t>(reduced(300, 12)), {3.0F, 0, glm::vec3(0.5F), 0.001F})};
    for (const Prior prior : k_sampled_priors) {
      CAPTURE(to_string(prior));
      SyntheticFrame frame(pixels);
      const auto image = frame.forward(sampled_joint(prior, prior, k_rigid, 8), k_background);
      const auto g = frame.backward(k_background, std::vector<cl_float4>(pixels.size(), k_grad));
      CHECK(image[0].s[0] == k_background.x);
      CHECK(image[0].s[3] == 0.0F);
      for (std::size_t i = 0; i < pixels.size(); ++i) {
        for (const float value : image[i].s) CHECK(std::isfinite(value));
        CHECK(std::isfinite(g.sigma[i] + g.gamma[i] + g.background[i].x));
        for (std::size_t k = 0; k < pixels[i].size(); ++k) {
          CHECK(std::isfinite(g.distance[i][k] + g.depth[i][k] + g.red[i][k] + g.green[i][k] + g.blue[i][k]));
        }
      }
    }
  }
}

}  // namespace aggregate_joint_sampled_test
