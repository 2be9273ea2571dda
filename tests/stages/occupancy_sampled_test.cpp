// The sampled occupancy against the exact one: values, gradients and sensitivities for each prior, baseline
// and way of drawing, within four standard errors that the samples themselves give. Every pixel draws its own
// noise, so that many equal pixels are many independent estimates.
#include <doctest/doctest.h>

#include <cmath>

#include "reference/occupancy.hpp"
#include "stages/occupancy.hpp"
#include "support/estimates.hpp"
#include "support/made_bin.hpp"
#include "support/probe.hpp"
#include "support/reduced.hpp"

namespace occupancy_sampled_test {

namespace {

namespace ref = dpr::reference;
using dpr::Draws;
using dpr::Prior;
using dpr::Smoothing;
using dpr::VarianceReduction;
using dpr::test::device_impl;
using dpr::test::Estimate;
using dpr::test::k_sampled_priors;
using dpr::test::poison;
using dpr::test::reduced;
using dpr::test::SamplingMode;

double number(float value) { return static_cast<double>(value); }

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
    const std::vector<cl_uint2> masks(faces.size(), run_ == 64 ? cl_uint2{{all, all}} : cl_uint2{{0xffU, 0}});
    frame_.width = k_width;
    frame_.height = static_cast<cl_uint>(count_ / k_width + 1);
    frame_.faces = static_cast<cl_uint>(xs.size());
    frame_.views = 1;
    dpr::test::make_pairs(bin_, faces);
    rasterize_.fragments = pixels.size();
    rasterize_.masks.upload(device_impl(), masks);
    rasterize_.fragment_starts.upload(device_impl(), starts);
    rasterize_.fragment_pixel.upload(device_impl(), pixels);
    frame_.last_pair = static_cast<cl_uint>(faces.size());
    frame_.fragments = frame_.grad_fragments = static_cast<cl_uint>(pixels.size() + dpr::k_widest_vector);
    dpr::test::set_planes(rasterize_.values, frame_.fragments, {{DPR_PLANE_DISTANCE, distance}});
  }

  void run(const Smoothing& smoothing) {
    occupancy_.set_smoothing(smoothing);
    occupancy_.forward(frame_, bin_, rasterize_);
    p = rasterize_.plane(frame_, DPR_PLANE_OCCUPANCY);
    log_p = rasterize_.plane(frame_, DPR_PLANE_LOG_OCCUPANCY);
    // The stage divides by its own estimate of p, because it gives the gradient of ln p: with p as the
    // incoming gradient what comes out is the gradient of p, and unbiased.
    dpr::test::set_planes(rasterize_.grads, frame_.grad_fragments, {{DPR_PLANE_LOG_OCCUPANCY, p}});
    poison(occupancy_.grad_sigma, bin_.pairs);
    occupancy_.backward(frame_, bin_, rasterize_);
    grad_distance = rasterize_.grad_plane(frame_, DPR_PLANE_DISTANCE);
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
  std::size_t run_ = static_cast<std::size_t>(reduced(64, 8));  // fragments of a pair, whole vectors
};

Smoothing sampled_occupancy(Prior prior, SamplingMode mode, std::uint32_t samples, std::uint64_t seed = 1) {
  Smoothing smoothing = dpr::smoothing_preset("gaussian");
  smoothing.occupancy_prior = prior;
  smoothing.occupancy_estimator = dpr::Estimator::monte_carlo;
  smoothing.sigma = OccupancySamples::k_sigma;
  smoothing.samples = samples;
  smoothing.variance_reduction = mode.reduction;
  smoothing.draws = mode.draws;
  smoothing.seed = seed;
  validate(smoothing);
  return smoothing;
}

/// So many that no fragment is missed by all of them: ln 0 would take its gradient away. No multiple of a
/// block.
const auto k_samples = static_cast<std::uint32_t>(reduced(66, 18));
const std::vector<float> k_xs{-1.5F, -0.4F, 0.0F, 0.7F, 2.0F};
constexpr SamplingMode k_plain{VarianceReduction::none, Draws::independent};
constexpr SamplingMode k_rigid{VarianceReduction::rigid, Draws::independent};

std::size_t fragment_count() { return static_cast<std::size_t>(reduced(16384, 128)); }

}  // namespace

TEST_SUITE("statistical") {
  TEST_CASE("sampled occupancy: value, distance and sigma gradients are unbiased, every mode") {
    OccupancySamples samples(k_xs, fragment_count());
    for (const Prior c : k_sampled_priors) {
      for (const SamplingMode& mode : dpr::test::sampling_modes(c)) {
        samples.run(sampled_occupancy(c, mode, k_samples));
        for (std::size_t face = 0; face < k_xs.size(); ++face) {
          const std::string name = std::string(to_string(c)) + " " + mode.name();
          CAPTURE(name);
          CAPTURE(k_xs[face]);
          const auto prior = static_cast<ref::Prior>(c);
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

  TEST_CASE("sampled occupancy: the rigid baseline reduces the variance where the sign is clear") {
    OccupancySamples samples({2.5F}, fragment_count());
    for (const Prior prior : k_sampled_priors) {
      CAPTURE(to_string(prior));
      samples.run(sampled_occupancy(prior, k_plain, k_samples));
      const OccupancySamples::Estimates plain = samples.estimates(0);
      samples.run(sampled_occupancy(prior, k_rigid, k_samples));
      const OccupancySamples::Estimates rigid = samples.estimates(0);
      CHECK(rigid.by_distance.variance() < 0.7 * plain.by_distance.variance());
      CHECK(rigid.by_sigma.variance() < 0.7 * plain.by_sigma.variance());
      CHECK(rigid.p.variance() == plain.p.variance());
    }
  }

  TEST_CASE("sampled occupancy: what the other modes are worth where the sign is open") {
    OccupancySamples samples({0.0F}, fragment_count());
    const auto run = [&](VarianceReduction reduction, Draws draws) {
      samples.run(sampled_occupancy(Prior::gaussian, {reduction, draws}, 16));
      return samples.estimates(0);
    };
    const auto plain = run(VarianceReduction::none, Draws::independent);
    const auto rigid = run(VarianceReduction::rigid, Draws::independent);
    const auto others = run(VarianceReduction::leave_one_out, Draws::independent);
    const auto mirrored = run(VarianceReduction::none, Draws::antithetic);
    const auto stratified = run(VarianceReduction::none, Draws::stratified);
    CHECK(others.by_distance.variance() < 0.7 * rigid.by_distance.variance());
    CHECK(mirrored.p.variance() == 0);  // at distance 0 one half of every pair covers
    CHECK(mirrored.by_distance.variance() < 0.7 * plain.by_distance.variance());
    CHECK(stratified.p.variance() < 0.1 * plain.p.variance());
    CHECK(stratified.by_distance.variance() < 0.1 * plain.by_distance.variance());
  }

  TEST_CASE("sampled occupancy: pixels, faces and seeds draw noise of their own") {
    // The occupancies of two faces at distance zero are binomial and independent: their correlation vanishes.
    OccupancySamples samples({0.0F, 0.0F}, fragment_count());
    const auto run = [&](std::uint64_t seed) {
      samples.run(sampled_occupancy(Prior::gaussian, k_plain, 16, seed));
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
  TEST_CASE("sampled occupancy: the same seed gives the same bits, another seed does not") {
    for (const Prior prior : k_sampled_priors) {
      for (const SamplingMode& mode : dpr::test::sampling_modes(prior)) {
        CAPTURE(to_string(prior));
        CAPTURE(mode.name());
        OccupancySamples occupancy({0.3F}, 64);
        occupancy.run(sampled_occupancy(prior, mode, 8, 5));
        const std::vector<float> p = occupancy.p, grad = occupancy.grad_distance;
        occupancy.run(sampled_occupancy(prior, mode, 8, 6));
        CHECK(occupancy.grad_distance != grad);
        occupancy.run(sampled_occupancy(prior, mode, 8, 5));
        CHECK(occupancy.p == p);
        CHECK(occupancy.grad_distance == grad);
      }
    }
  }

  TEST_CASE("sampled occupancy: beyond the reach of the noise it is 0 or 1, and has no gradient") {
    for (const float x : {-30.0F, -5.5F, 5.5F, 30.0F}) {
      CAPTURE(x);
      OccupancySamples samples({x}, 64);
      samples.run(sampled_occupancy(Prior::gaussian, k_plain, 8));
      for (std::size_t i = 0; i < 64; ++i) {
        CHECK(samples.p[i] == (x > 0 ? 1.0F : 0.0F));
        CHECK(samples.log_p[i] == (x > 0 ? 0.0F : DPR_LOG_ZERO));
        CHECK(samples.grad_distance[i] == 0.0F);
      }
      for (const float grad : samples.grad_sigma) CHECK(grad == 0.0F);
    }
  }

  TEST_CASE("sampled occupancy: the number of samples need not be a multiple of a block") {
    OccupancySamples samples({0.0F}, 64);
    for (const std::uint32_t count : {1U, 2U, 3U, 5U, 9U}) {
      for (const Draws draws : {Draws::independent, Draws::stratified}) {
        CAPTURE(count);
        samples.run(sampled_occupancy(Prior::gaussian, {VarianceReduction::none, draws}, count));
        for (const float p : samples.p) {
          const float covered = p * static_cast<float>(count);
          CHECK(std::abs(covered - std::round(covered)) < 1e-5F);
          CHECK(p <= 1.0F);
        }
      }
    }
  }
}

}  // namespace occupancy_sampled_test
