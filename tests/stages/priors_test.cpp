// The priors' functions against closed forms in long double: F and f / F at any argument, and by way of the
// occupancy stage ln p, p and the hazard over the whole line, for every prior and from small to large sigma.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "stages/occupancy.hpp"
#include "support/made_bin.hpp"
#include "support/probe.hpp"
#include "support/reduced.hpp"
#include "support/worst.hpp"

namespace priors_test {

namespace {

using dpr::Buffer;
using dpr::Prior;
using dpr::test::device_impl;
using dpr::test::poison;
using dpr::test::Probe;
using dpr::test::Worst;

constexpr long double k_pi = std::numbers::pi_v<long double>;

/// ln p of p = 1 - F(-x), p and d ln p / dx.
struct Exact {
  long double log_p, p, hazard;
};

/// phi(x) / Phi(x) for x far below zero: Laplace's continued fraction.
long double gaussian_tail_hazard(long double x) {
  long double value = -x;
  for (int i = 60; i >= 1; --i) value = -x + static_cast<long double>(i) / value;
  return value;
}

Exact gaussian(long double x) {
  const long double log_density = -0.5L * x * x - 0.5L * std::log(2.0L * k_pi);
  if (x < -20.0L) {
    const long double hazard = gaussian_tail_hazard(x);
    const long double log_p = log_density - std::log(hazard);
    return {log_p, std::exp(log_p), hazard};
  }
  const long double lower = 0.5L * std::erfc(-x / std::numbers::sqrt2_v<long double>);
  const long double upper = 0.5L * std::erfc(x / std::numbers::sqrt2_v<long double>);
  return {x < 0.0L ? std::log(lower) : std::log1p(-upper), lower, std::exp(log_density) / lower};
}

Exact cauchy(long double x) {
  const long double tail = std::atan2(1.0L, std::abs(x)) / k_pi;
  const long double p = x < 0.0L ? tail : 1.0L - tail;
  return {x < 0.0L ? std::log(tail) : std::log1p(-tail), p, 1.0L / (k_pi * (1.0L + x * x) * p)};
}

Exact logistic(long double x) {
  const long double e = std::exp(-std::abs(x));
  const long double log_p = std::min(x, 0.0L) - std::log1p(e);
  return {log_p, std::exp(log_p), x < 0.0L ? 1.0L / (1.0L + e) : e / (1.0L + e)};
}

Exact gumbel(long double x) {
  const long double u = std::exp(x);
  if (u < 1e-9L) return {x - 0.5L * u, u, 1.0L - 0.5L * u};
  if (u > 1e4L) return {0.0L, 1.0L, 0.0L};
  const long double p = -std::expm1(-u);
  return {std::log(p), p, u / std::expm1(u)};
}

Exact uniform(long double x) {
  const long double p = std::clamp(x + 0.5L, 0.0L, 1.0L);
  return {std::log(p), p, p > 0.0L && p < 1.0L ? 1.0L / p : 0.0L};
}

/// Tolerances, twice the worst error measured. `log_p`: |error| / max(1, |ln p|); `p`: absolute; `hazard`:
/// relative above 1e-25: further out Gumbel's exp(-exp(x)) stands still at 7e-31.
struct PriorCase {
  Prior prior;
  std::string_view name;
  Exact (*exact)(long double);
  double log_p, p, hazard;
};

/// Measured on x in [-1e4, 1e4] with sigma from 1e-7 to 1:
///   prior      ln p     p        hazard
///   gaussian   4.2e-7   2.4e-7   6.6e-6   (in the upper tail, where exp(-x^2 / 2) magnifies the rounding of
///   x) cauchy     1.5e-7   9.0e-8   3.1e-7 logistic   9.8e-8   6.6e-8   2.0e-6
///   gumbel     2.7e-7   7.7e-8   1.4e-5   (in the upper tail, by exp(-exp(x)))
///   uniform    1.2e-6   8.0e-8   7.6e-6   (near x = -1/2, where p = x + 1/2 cancels)
constexpr std::array<PriorCase, 5> k_priors{{{Prior::gaussian, "gaussian", gaussian, 8e-7, 5e-7, 1.3e-5},
                                             {Prior::cauchy, "cauchy", cauchy, 3e-7, 1.8e-7, 6e-7},
                                             {Prior::logistic, "logistic", logistic, 2e-7, 1.3e-7, 4e-6},
                                             {Prior::gumbel, "gumbel", gumbel, 5e-7, 1.5e-7, 2.8e-5},
                                             {Prior::uniform, "uniform", uniform, 2.4e-6, 1.6e-7, 1.5e-5}}};

/// The line, dense where the priors bend and through every tail: multiples of sigma.
std::vector<float> line() {
  const int count = dpr::test::reduced(400, 3);
  std::vector<float> xs{0.0F, -0.0F, 1e4F, -1e4F, 0.5F, -0.5F, 1.0F, -1.0F, 1e-6F, -1e-6F};
  const auto step = [&](int i) { return (static_cast<float>(i) + 0.37F) / static_cast<float>(count); };
  for (int i = 0; i < count; ++i) {
    for (const float sign : {-1.0F, 1.0F}) {
      xs.push_back(sign * step(i));
      xs.push_back(sign * 5.0F * step(i));
      xs.push_back(sign * 30.0F * step(i));
      xs.push_back(sign * std::pow(10.0F, 4.0F * step(i)));
      xs.push_back(sign * std::pow(10.0F, -6.0F * step(i)));
    }
  }
  return xs;
}

/// The occupancy stage on a list of distances, in runs of 13 fragments: no multiple of a vector's lanes.
class Distances {
 public:
  static constexpr std::size_t k_run = 13;

  explicit Distances(const std::vector<float>& values)
      : bin_(device_impl()), rasterize_(device_impl()), occupancy_(device_impl()) {
    std::vector<cl_uint> starts{0};
    while (starts.back() < values.size()) {
      starts.push_back(static_cast<cl_uint>(std::min(starts.back() + k_run, values.size())));
    }
    dpr::test::make_pairs(bin_, std::vector<cl_uint>(starts.size() - 1));
    rasterize_.fragments = values.size();
    rasterize_.fragment_starts.upload(device_impl(), starts);
    frame_.last_pair = static_cast<cl_uint>(starts.size() - 1);
    frame_.fragments = frame_.grad_fragments = static_cast<cl_uint>(values.size() + dpr::k_widest_vector);
    dpr::test::set_planes(rasterize_.values, frame_.fragments, {{DPR_PLANE_DISTANCE, values}});
  }

  void forward(Prior prior, float sigma) {
    dpr::Smoothing smoothing = dpr::smoothing_preset("gaussian");
    smoothing.occupancy_prior = prior;
    smoothing.sigma = sigma;
    occupancy_.set_smoothing(smoothing);
    occupancy_.forward(frame_, bin_, rasterize_);
    log_p = rasterize_.plane(frame_, DPR_PLANE_LOG_OCCUPANCY);
    p = rasterize_.plane(frame_, DPR_PLANE_OCCUPANCY);
  }

  /// `grads` one for each distance.
  void backward(const std::vector<float>& grads) {
    dpr::test::set_planes(rasterize_.grads, frame_.grad_fragments, {{DPR_PLANE_LOG_OCCUPANCY, grads}});
    poison(occupancy_.grad_sigma, bin_.pairs);
    occupancy_.backward(frame_, bin_, rasterize_);
    grad_distance = rasterize_.grad_plane(frame_, DPR_PLANE_DISTANCE);
    grad_sigma = occupancy_.grad_sigma.download();
  }

  static std::size_t pair(std::size_t i) { return i / k_run; }

  std::vector<float> log_p, p, grad_distance;  // by distance
  std::vector<float> grad_sigma;               // by pair

 private:
  dpr::shared::FrameParams frame_{};
  dpr::Bin bin_;
  dpr::Rasterize rasterize_;
  dpr::Occupancy occupancy_;
};

double relative(double found, double expected, double floor) {
  return std::abs(found - expected) / std::max(std::abs(expected), floor);
}

constexpr std::array<float, 5> k_sigmas{1e-7F, 1e-5F, 1e-3F, 3e-2F, 1.0F};

/// A number that the hazard may underflow below, see PriorCase.
constexpr double k_least_hazard = 1e-25;

/// Distances that are the given multiples of sigma, as nearly as floats allow.
std::vector<float> scaled(std::vector<float> xs, float sigma) {
  for (float& x : xs) x *= sigma;
  return xs;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("occupancy: ln p and p over the whole line, every prior, every sigma") {
    for (const float sigma : k_sigmas) {
      const std::vector<float> distances = scaled(line(), sigma);
      Distances stage(distances);
      for (const PriorCase& c : k_priors) {
        CAPTURE(std::string(c.name));
        CAPTURE(sigma);
        stage.forward(c.prior, sigma);
        Worst log_p, p, moved;
        for (std::size_t i = 0; i < distances.size(); ++i) {
          const long double x = static_cast<long double>(distances[i]) / static_cast<long double>(sigma);
          const Exact exact = c.exact(x);
          const double wanted = std::max(static_cast<double>(exact.log_p), static_cast<double>(DPR_LOG_ZERO));
          const auto found = static_cast<double>(stage.log_p[i]);
          log_p.add(relative(found, wanted, 1.0), "x", static_cast<double>(x), "found", found, "wanted",
                    wanted);
          p.add(std::abs(static_cast<double>(stage.p[i]) - static_cast<double>(exact.p)), "x",
                static_cast<double>(x));
          moved.add(relative(found, wanted + 1e-4, 1.0));
        }
        DPR_CHECK_WORST(log_p, c.log_p);
        DPR_CHECK_WORST(p, c.p);
        CHECK(moved.error > c.log_p);
      }
    }
  }

  TEST_CASE("occupancy: the Gaussian's logarithm down to x = -30, where p is 1e-198") {
    std::vector<float> xs;
    for (int i = 0; i <= 300; i += dpr::test::reduced(1, 100)) xs.push_back(-0.1F * static_cast<float>(i));
    Distances stage(xs);
    stage.forward(Prior::gaussian, 1.0F);
    Worst worst;
    for (std::size_t i = 0; i < xs.size(); ++i) {
      const auto wanted = static_cast<double>(gaussian(static_cast<long double>(xs[i])).log_p);
      worst.add(relative(static_cast<double>(stage.log_p[i]), wanted, 0.5), "x", xs[i]);
    }
    DPR_CHECK_WORST(worst, 4e-7);
  }

  TEST_CASE("occupancy: an occupancy of zero has a finite logarithm, and no gradient") {
    Distances stage({-1.0F, -0.5F, 0.5F, 1.0F});
    stage.forward(Prior::uniform, 1.0F);
    CHECK(stage.log_p == std::vector<float>{DPR_LOG_ZERO, DPR_LOG_ZERO, 0.0F, 0.0F});
    CHECK(stage.p == std::vector<float>{0.0F, 0.0F, 1.0F, 1.0F});
    stage.backward({1.0F, 1.0F, 1.0F, 1.0F});
    CHECK(stage.grad_distance == std::vector<float>(4, 0.0F));
    CHECK(stage.grad_sigma == std::vector<float>{0.0F});
  }

  TEST_CASE("occupancy: distances that are not finite numbers of sigmas give no NaN") {
    const float huge = std::numeric_limits<float>::max();
    for (const PriorCase& c : k_priors) {
      CAPTURE(std::string(c.name));
      Distances stage({-huge, huge, -std::numeric_limits<float>::infinity()});
      stage.forward(c.prior, 1e-7F);
      stage.backward({1.0F, 1.0F, 1.0F});
      for (std::size_t i = 0; i < 3; ++i) {
        CHECK(std::isfinite(stage.log_p[i]));
        CHECK(stage.log_p[i] >= DPR_LOG_ZERO);
        CHECK(std::abs(stage.p[i] - (i == 1 ? 1.0F : 0.0F)) < 1e-14F);
        CHECK(!std::isnan(stage.grad_distance[i]));
      }
    }
  }

  TEST_CASE("prior_cdf_density: F and f / F at any argument") {
    const std::vector<float> all = line();
    const std::size_t width = 16;  // as aggregation uses it
    std::vector<float> xs = all;
    while (xs.size() % width != 0) xs.push_back(0.0F);
    const Buffer<float> in(device_impl(), std::span<const float>(xs));
    for (const PriorCase& c : k_priors) {
      CAPTURE(std::string(c.name));
      Probe probe({"shared_types.h", "lanes.h", "priors.h"}, R"(
kernel void probe(global const float* restrict in, global float* restrict cdfs,
                  global float* restrict ratios) {
  const uint i = (uint)get_global_id(0) * DPR_WIDTH;
  realn cdf, density;
  prior_cdf_density(load_n(i, in), &cdf, &density);
  store_n(cdf, i, cdfs);
  store_n(density / cdf, i, ratios);
})",
                  " -DDPR_WIDTH=16" + dpr::prior_option(c.prior));
      Buffer<float> cdf_buffer, ratio_buffer;
      poison(cdf_buffer, xs.size());
      poison(ratio_buffer, xs.size());
      probe(xs.size() / width, in, cdf_buffer, ratio_buffer);
      const std::vector<float> cdfs = cdf_buffer.download(), ratios = ratio_buffer.download();
      Worst cdf, ratio, doubled;
      for (std::size_t i = 0; i < xs.size(); ++i) {
        const auto x = static_cast<long double>(xs[i]);
        // Gumbel's F is no reflection of its survival function; below x = -4.2 its F is less than 1e-29, and
        // clamped.
        const bool is_gumbel = c.prior == Prior::gumbel;
        if (is_gumbel && x < -4.2L) continue;
        const auto density_there = static_cast<double>(c.exact(x).p * c.exact(x).hazard);
        if (density_there < 1e-30) continue;  // below the smallest normal numbers a quotient means nothing
        const auto wanted_cdf = static_cast<double>(is_gumbel ? std::exp(-std::exp(-x)) : c.exact(x).p);
        const auto wanted_ratio = static_cast<double>(is_gumbel ? std::exp(-x) : c.exact(x).hazard);
        cdf.add(std::abs(static_cast<double>(cdfs[i]) - wanted_cdf), "x", xs[i]);
        ratio.add(relative(static_cast<double>(ratios[i]), wanted_ratio, k_least_hazard), "x", xs[i], "found",
                  ratios[i], "wanted", wanted_ratio);
        doubled.add(relative(2.0 * static_cast<double>(ratios[i]), wanted_ratio, k_least_hazard));
      }
      DPR_CHECK_WORST(cdf, c.p);
      DPR_CHECK_WORST(ratio, c.hazard);
      CHECK(doubled.error > c.hazard);
    }
  }

  TEST_CASE("exp_n: relative error below 2e-7 in every width, zero below -87") {
    std::vector<float> xs{0.0F, -87.0F, 88.0F, -87.5F, -1000.0F, -1e30F};
    for (int i = 0; i < dpr::test::reduced(4000, 10); ++i) {
      const float part = (static_cast<float>(i) + 0.5F) / static_cast<float>(dpr::test::reduced(4000, 10));
      xs.push_back(-86.9F + 174.8F * part);
      xs.push_back(2.0F * part - 1.0F);
    }
    while (xs.size() % 16 != 0) xs.push_back(0.0F);
    const Buffer<float> in(device_impl(), std::span<const float>(xs));
    for (const int width : {1, 4, 8, 16}) {
      CAPTURE(width);
      Probe probe({"shared_types.h", "lanes.h"}, R"(
kernel void probe(global const float* restrict in, global float* restrict out) {
  const uint i = (uint)get_global_id(0) * DPR_WIDTH;
  store_n(exp_n(load_n(i, in)), i, out);
})",
                  " -DDPR_WIDTH=" + std::to_string(width));
      Buffer<float> out;
      poison(out, xs.size());
      probe(xs.size() / static_cast<std::size_t>(width), in, out);
      const std::vector<float> found = out.download();
      Worst worst;
      for (std::size_t i = 0; i < xs.size(); ++i) {
        if (xs[i] < -87.0F) {
          CHECK(found[i] <= 1.7e-38F);
        } else {
          worst.add(relative(static_cast<double>(found[i]), std::exp(static_cast<double>(xs[i])), 0.0), "x",
                    xs[i]);
        }
      }
      DPR_CHECK_WORST(worst, 2e-7);
    }
  }

  TEST_CASE("a comparison with something that is not a number fails") {
    Worst worst;
    worst.add(0.5, "half");
    worst.add(std::numeric_limits<double>::quiet_NaN(), "poison");
    CHECK(worst.where == "poison ");
    CHECK_FALSE(worst.error <= 1e30);
  }
}

TEST_SUITE("gradient") {
  TEST_CASE("occupancy: gradients of distance and sigma, every prior, every sigma") {
    for (const float sigma : k_sigmas) {
      const std::vector<float> distances = scaled(line(), sigma);
      Distances stage(distances);
      std::vector<float> grads;
      for (std::size_t i = 0; i < distances.size(); ++i) grads.push_back(i % 2 == 0 ? 0.75F : -1.25F);
      for (const PriorCase& c : k_priors) {
        CAPTURE(std::string(c.name));
        CAPTURE(sigma);
        stage.forward(c.prior, sigma);
        stage.backward(grads);
        Worst hazard, sum, halved;
        std::vector<double> sums(stage.grad_sigma.size(), 0.0), sizes(stage.grad_sigma.size(), 0.0);
        for (std::size_t i = 0; i < distances.size(); ++i) {
          const long double x = static_cast<long double>(distances[i]) / static_cast<long double>(sigma);
          const auto exact = static_cast<double>(c.exact(x).hazard);
          const double found = static_cast<double>(stage.grad_distance[i]) * static_cast<double>(sigma) /
                               static_cast<double>(grads[i]);
          hazard.add(relative(found, exact, k_least_hazard), "x", static_cast<double>(x), "found", found);
          halved.add(relative(found, 2.0 * exact, k_least_hazard));
          const double share =
              -static_cast<double>(x) * exact * static_cast<double>(grads[i]) / static_cast<double>(sigma);
          sums[stage.pair(i)] += share;
          sizes[stage.pair(i)] += std::abs(share);
        }
        for (std::size_t pair = 0; pair < sums.size(); ++pair) {
          // Relative to the sum of the magnitudes: the terms cancel.
          sum.add(std::abs(static_cast<double>(stage.grad_sigma[pair]) - sums[pair]) /
                      std::max(sizes[pair], 1e-30),
                  "pair", pair);
        }
        DPR_CHECK_WORST(hazard, c.hazard);
        DPR_CHECK_WORST(sum, c.hazard);
        CHECK(halved.error > c.hazard);
        for (const float grad : stage.grad_distance) CHECK(!std::isnan(grad));
      }
    }
  }
}

}  // namespace priors_test
