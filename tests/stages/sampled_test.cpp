// The sampled estimators against the exact expectations: values, gradients and sensitivities of occupancy and
// barrier aggregation, for each prior with and without the control variate, within four standard errors that
// the samples themselves give. Every pixel draws its own noise, so that many equal pixels are many
// independent estimates.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <functional>

#include "reference/occupancy.hpp"
#include "support/aggregate_errors.hpp"
#include "support/synthetic_pixels.hpp"

namespace {

namespace ref = dpr::reference;
using dpr::Prior;
using dpr::Smoothing;
using dpr::VarianceReduction;
using dpr::test::device_impl;
using dpr::test::number;
using dpr::test::poison;
using dpr::test::reduced;
using dpr::test::SyntheticFragment;
using dpr::test::SyntheticFrame;
using dpr::test::SyntheticPixel;

struct PriorCase {
  Prior prior;
  std::string_view name;
};
constexpr std::array<PriorCase, 4> k_priors{{{Prior::gaussian, "gaussian"},
                                             {Prior::cauchy, "cauchy"},
                                             {Prior::logistic, "logistic"},
                                             {Prior::gumbel, "gumbel"}}};
constexpr std::array<VarianceReduction, 2> k_modes{VarianceReduction::none, VarianceReduction::rigid};

/// Mean and its standard error of independent estimates.
struct Estimate {
  double sum = 0, squares = 0;
  std::size_t count = 0;
  void add(double value) {
    sum += value;
    squares += value * value;
    ++count;
  }
  double mean() const { return sum / static_cast<double>(count); }
  double variance() const { return std::max(squares / static_cast<double>(count) - mean() * mean(), 0.0); }
  double standard_error() const { return std::sqrt(variance() / static_cast<double>(count - 1)); }
  /// Whether the mean is within four standard errors of `exact`, or the estimates all agree with it.
  bool agrees_with(double exact) const {
    return std::abs(mean() - exact) <= 4 * standard_error() + 1e-6 * std::max(1.0, std::abs(exact));
  }
};

#define DPR_CHECK_ESTIMATE(estimate, exact)                      \
  do {                                                           \
    const Estimate& checked = (estimate);                        \
    const double wanted_value = (exact);                         \
    CAPTURE(checked.mean());                                     \
    CAPTURE(checked.standard_error());                           \
    CAPTURE(wanted_value);                                       \
    CHECK_MESSAGE(checked.agrees_with(wanted_value), #estimate); \
  } while (false)

// Occupancy.

/// Fragments of one distance, each in a pixel of its own: a face for every distance.
class OccupancySamples {
 public:
  static constexpr float k_sigma = 0.01F;

  OccupancySamples(const std::vector<float>& xs, std::size_t count)
      : bin_(device_impl()), rasterize_(device_impl()), occupancy_(device_impl()), count_(count) {
    std::vector<cl_uint> faces, starts{0}, pixels;
    std::vector<float> distance;
    for (std::size_t face = 0; face < xs.size(); ++face) {
      for (std::size_t i = 0; i < count_; ++i) {
        pixels.push_back(static_cast<cl_uint>(i % k_width | i / k_width << 16U));
        distance.push_back(xs[face] * k_sigma);
        if ((i + 1) % run_ == 0) {
          faces.push_back(static_cast<cl_uint>(face));
          starts.push_back(static_cast<cl_uint>(pixels.size()));
        }
      }
    }
    const cl_uint all = 0xffffffffU;
    const std::vector<cl_uint2> masks(faces.size(), run_ == 64 ? cl_uint2{{all, all}} : cl_uint2{{0xfU, 0}});
    frame_.width = k_width;
    frame_.height = static_cast<cl_uint>(count_ / k_width + 1);
    frame_.faces = static_cast<cl_uint>(xs.size());
    frame_.views = 1;
    bin_.pairs = faces.size();
    bin_.pair_face.upload(device_impl(), faces);
    rasterize_.fragments = pixels.size();
    rasterize_.masks.upload(device_impl(), masks);
    rasterize_.fragment_starts.upload(device_impl(), starts);
    rasterize_.fragment_pixel.upload(device_impl(), pixels);
    rasterize_.distance.upload(device_impl(), distance);
  }

  void run(const Smoothing& smoothing) {
    occupancy_.set_smoothing(smoothing);
    poison(occupancy_.log_occupancy, rasterize_.fragments);
    poison(occupancy_.occupancy, rasterize_.fragments);
    occupancy_.forward(frame_, bin_, rasterize_);
    p = occupancy_.occupancy.download();
    log_p = occupancy_.log_occupancy.download();
    // The stage divides by its own estimate of p, because it gives the gradient of ln p: with p as the
    // incoming gradient what comes out is the gradient of p, and unbiased.
    const dpr::Buffer<float> grad(device_impl(), std::span<const float>(p));
    poison(occupancy_.grad_distance, rasterize_.fragments);
    poison(occupancy_.grad_sigma, bin_.pairs);
    occupancy_.backward(frame_, bin_, rasterize_, grad);
    grad_distance = occupancy_.grad_distance.download();
    grad_sigma = occupancy_.grad_sigma.download();
  }

  /// Estimates of p, of sigma dp/ds, and of sigma dp/dsigma (from sums over runs) at the distance number
  /// `face`.
  struct Estimates {
    Estimate p, by_distance, by_sigma;
  };
  Estimates estimates(std::size_t face) const {
    Estimates e;
    for (std::size_t i = face * count_; i < (face + 1) * count_; ++i) {
      e.p.add(number(p[i]));
      e.by_distance.add(number(grad_distance[i]) * number(k_sigma));
    }
    const std::size_t runs = count_ / run_;
    for (std::size_t i = face * runs; i < (face + 1) * runs; ++i) {
      e.by_sigma.add(number(grad_sigma[i]) * number(k_sigma) / static_cast<double>(run_));
    }
    return e;
  }

  std::vector<float> p, log_p, grad_distance, grad_sigma;

 private:
  static constexpr cl_uint k_width = 128;

  dpr::Bin bin_;
  dpr::Rasterize rasterize_;
  dpr::Occupancy occupancy_;
  dpr::shared::FrameParams frame_{};
  std::size_t count_;                                           // a multiple of run_
  std::size_t run_ = static_cast<std::size_t>(reduced(64, 4));  // fragments of a pair
};

Smoothing sampled_occupancy(Prior prior, VarianceReduction mode, std::uint32_t samples,
                            std::uint64_t seed = 1) {
  Smoothing smoothing;
  smoothing.occupancy_prior = prior;
  smoothing.occupancy_estimator = dpr::Estimator::monte_carlo;
  smoothing.sigma = OccupancySamples::k_sigma;
  smoothing.samples = samples;
  smoothing.variance_reduction = mode;
  smoothing.seed = seed;
  return smoothing;
}

/// So many that no fragment is missed by all of them: ln 0 would take its gradient away.
const auto k_occupancy_samples = static_cast<std::uint32_t>(reduced(67, 19));
const std::vector<float> k_xs{-1.5F, -0.4F, 0.0F, 0.7F, 2.0F};

std::size_t occupancy_count() { return static_cast<std::size_t>(reduced(32768, 128)); }

// Aggregation.

const std::vector<SyntheticFragment> k_fragments{{2.0F, 0.6F, glm::vec3(0.9F, 0.1F, 0.3F)},
                                                 {2.6F, 0.9F, glm::vec3(0.2F, 0.8F, 0.5F)},
                                                 {3.1F, 1.0F, glm::vec3(0.4F, 0.3F, 0.9F)},
                                                 {2.2F, 0.0F, glm::vec3(0.5F, 0.5F, 0.5F)}};
constexpr glm::vec3 k_background{0.7F, 0.2F, 0.1F};
constexpr cl_float4 k_grad{{0.8F, -0.5F, 0.6F, 0.4F}};

Smoothing sampled_aggregation(Prior prior, VarianceReduction mode, std::uint32_t samples,
                              std::uint64_t seed = 1) {
  Smoothing smoothing;
  smoothing.depth_prior = prior;
  smoothing.aggregation_estimator = dpr::Estimator::monte_carlo;
  smoothing.gamma = 0.01F;  // 1 in depth: the fragments' noise overlaps
  smoothing.alpha = 0.8F;
  smoothing.background_depth = 0.97F;  // the background takes its share
  smoothing.samples = samples;
  smoothing.variance_reduction = mode;
  smoothing.seed = seed;
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
    Estimate e;
    for (std::size_t i = 0; i < count; ++i) e.add(value(i));
    return e;
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

std::size_t pixel_count() { return static_cast<std::size_t>(reduced(24000, 64)); }

bool same(const std::vector<cl_float4>& a, const std::vector<cl_float4>& b) {
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t c = 0; c < 4; ++c) {
      if (a[i].s[c] != b[i].s[c]) return false;
    }
  }
  return a.size() == b.size();
}

ref::AggregateGradient exact_gradient(const Smoothing& smoothing) {
  return ref::aggregate_backward(
      dpr::test::reference_fragments(k_fragments), dpr::test::reference_parameters(smoothing, k_background),
      {number(k_grad.s[0]), number(k_grad.s[1]), number(k_grad.s[2])}, number(k_grad.s[3]));
}

}  // namespace

TEST_SUITE("statistical") {
  TEST_CASE("sampled occupancy: value, distance and sigma gradients are unbiased") {
    OccupancySamples samples(k_xs, occupancy_count());
    for (const PriorCase& c : k_priors) {
      for (const VarianceReduction mode : k_modes) {
        samples.run(sampled_occupancy(c.prior, mode, k_occupancy_samples));
        for (std::size_t face = 0; face < k_xs.size(); ++face) {
          const std::string name(c.name), reduction(dpr::to_string(mode));
          CAPTURE(name);
          CAPTURE(reduction);
          CAPTURE(k_xs[face]);
          const auto prior = static_cast<ref::Prior>(c.prior);
          const double x = number(k_xs[face] * OccupancySamples::k_sigma) / number(OccupancySamples::k_sigma);
          const OccupancySamples::Estimates e = samples.estimates(face);
          const double slope = ref::density(prior, -x);
          DPR_CHECK_ESTIMATE(e.p, ref::survival(prior, -x));
          DPR_CHECK_ESTIMATE(e.by_distance, slope);
          DPR_CHECK_ESTIMATE(e.by_sigma, -x * slope);
          // A value that is further off than the noise is refused.
          CHECK_FALSE(e.p.agrees_with(ref::survival(prior, -x) + 9 * e.p.standard_error() + 1e-5));
          CHECK_FALSE(e.by_sigma.agrees_with(-x * slope - 9 * e.by_sigma.standard_error() - 1e-5));
        }
      }
    }
  }

  TEST_CASE("sampled occupancy: the control variate reduces the variance where the sign is clear") {
    OccupancySamples samples({2.5F}, occupancy_count());
    for (const PriorCase& c : k_priors) {
      CAPTURE(std::string(c.name));
      samples.run(sampled_occupancy(c.prior, VarianceReduction::none, k_occupancy_samples));
      const OccupancySamples::Estimates plain = samples.estimates(0);
      samples.run(sampled_occupancy(c.prior, VarianceReduction::rigid, k_occupancy_samples));
      const OccupancySamples::Estimates rigid = samples.estimates(0);
      CHECK(rigid.by_distance.variance() < 0.7 * plain.by_distance.variance());
      CHECK(rigid.by_sigma.variance() < 0.7 * plain.by_sigma.variance());
      CHECK(rigid.p.variance() == plain.p.variance());
    }
  }

  TEST_CASE("sampled aggregation: image, weights and every gradient are unbiased") {
    AggregateSamples samples(pixel_count());
    for (const PriorCase& c : k_priors) {
      for (const VarianceReduction mode : k_modes) {
        const std::string name(c.name), reduction(dpr::to_string(mode));
        CAPTURE(name);
        CAPTURE(reduction);
        const Smoothing smoothing = sampled_aggregation(c.prior, mode, 9);
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
    for (const PriorCase& c : k_priors) {
      CAPTURE(std::string(c.name));
      samples.run(sampled_aggregation(c.prior, VarianceReduction::none, 8));
      const Estimate plain_depth = samples.by_depth(0), plain_gamma = samples.by_gamma();
      samples.run(sampled_aggregation(c.prior, VarianceReduction::rigid, 8));
      CHECK(samples.by_depth(0).variance() < 0.5 * plain_depth.variance());
      CHECK(samples.by_gamma().variance() < 0.5 * plain_gamma.variance());
    }
  }

  TEST_CASE("sampled stages: pixels, faces, stages and seeds draw noise of their own") {
    // Of two faces at distance zero the occupancies are binomial and independent: their correlation vanishes.
    OccupancySamples samples({0.0F, 0.0F}, occupancy_count());
    const auto run = [&](std::uint64_t seed) {
      samples.run(sampled_occupancy(Prior::gaussian, VarianceReduction::none, 16, seed));
      return samples.p;
    };
    const std::vector<float> first = run(1), other_seed = run(2),
                             high_seed = run((std::uint64_t{1} << 32U) + 1);
    const std::size_t n = first.size() / 2;
    const auto correlation = [&](const std::vector<float>& a, std::size_t a0, const std::vector<float>& b,
                                 std::size_t b0, std::size_t count) {
      double sum = 0;
      for (std::size_t i = 0; i < count; ++i) sum += (number(a[a0 + i]) - 0.5) * (number(b[b0 + i]) - 0.5);
      return sum / static_cast<double>(count) * 4 * 16;  // the variance of a mean of 16 is 1 / 64
    };
    const double limit = 4 / std::sqrt(static_cast<double>(n));
    CHECK(std::abs(correlation(first, 0, first, n, n)) < limit);
    CHECK(std::abs(correlation(first, 0, first, 1, n - 1)) < limit);  // neighbouring pixels
    CHECK(std::abs(correlation(first, 0, other_seed, 0, n)) < limit);
    CHECK(std::abs(correlation(first, 0, high_seed, 0, n)) < limit);
    CHECK(correlation(first, 0, first, 0, n) > 0.5);  // with itself it does not vanish
  }
}

TEST_SUITE("unit") {
  TEST_CASE("sampled stages: the same seed gives the same bits, another seed does not") {
    for (const PriorCase& c : k_priors) {
      CAPTURE(std::string(c.name));
      AggregateSamples samples(64);
      samples.run(sampled_aggregation(c.prior, VarianceReduction::rigid, 8, 5));
      const std::vector<cl_float4> image = samples.image;
      const std::vector<float> gamma = samples.gradients.gamma;
      samples.run(sampled_aggregation(c.prior, VarianceReduction::rigid, 8, 6));
      CHECK_FALSE(same(samples.image, image));
      CHECK(samples.gradients.gamma != gamma);
      samples.run(sampled_aggregation(c.prior, VarianceReduction::rigid, 8, 5));
      CHECK(same(samples.image, image));
      CHECK(samples.gradients.gamma == gamma);

      OccupancySamples occupancy({0.3F}, 64);
      occupancy.run(sampled_occupancy(c.prior, VarianceReduction::rigid, 8, 5));
      const std::vector<float> p = occupancy.p, grad = occupancy.grad_distance;
      occupancy.run(sampled_occupancy(c.prior, VarianceReduction::rigid, 8, 6));
      CHECK(occupancy.p != p);
      occupancy.run(sampled_occupancy(c.prior, VarianceReduction::rigid, 8, 5));
      CHECK(occupancy.p == p);
      CHECK(occupancy.grad_distance == grad);
    }
  }

  TEST_CASE("sampled aggregation: the backward pass draws the forward pass' noise") {
    // The weights that the gradients of the colours carry are those of the image, to the last bit: both are
    // counts of winners over a power of two.
    const SyntheticPixel pixel{{2.0F, 1.0F, glm::vec3(1, 0, 0)}, {2.5F, 0.8F, glm::vec3(0, 1, 0)}};
    for (const PriorCase& c : k_priors) {
      CAPTURE(std::string(c.name));
      AggregateSamples samples(64, pixel);
      Smoothing smoothing = sampled_aggregation(c.prior, VarianceReduction::rigid, 16);
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

  TEST_CASE("sampled occupancy: what no sample covers is absent, and has no gradient") {
    OccupancySamples samples({-30.0F}, 64);
    samples.run(sampled_occupancy(Prior::gaussian, VarianceReduction::rigid, 8));
    for (std::size_t i = 0; i < 64; ++i) {
      CHECK(samples.p[i] == 0.0F);
      CHECK(samples.log_p[i] == DPR_LOG_ZERO);
      CHECK(samples.grad_distance[i] == 0.0F);
    }
    for (const float grad : samples.grad_sigma) CHECK(grad == 0.0F);
  }

  TEST_CASE("sampled stages: the number of samples need not be a multiple of four") {
    OccupancySamples samples({0.0F}, 64);
    for (const std::uint32_t count : {1U, 2U, 3U, 5U}) {
      CAPTURE(count);
      samples.run(sampled_occupancy(Prior::gaussian, VarianceReduction::none, count));
      for (const float p : samples.p) {
        const float covered = p * static_cast<float>(count);
        CHECK(std::abs(covered - std::round(covered)) < 1e-5F);
        CHECK(p <= 1.0F);
      }
    }
    AggregateSamples pixels(8);
    for (const std::uint32_t count : {1U, 3U}) {
      pixels.run(sampled_aggregation(Prior::gaussian, VarianceReduction::none, count));
      for (const cl_float4& pixel : pixels.image) CHECK(pixel.s[0] <= 0.9F + 1e-6F);
    }
  }
}
