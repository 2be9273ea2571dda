// The counter-based generator against its published known answers, and what is drawn with it: uniform
// numbers, the priors' samplers against the exact inverse CDFs, their scores against the reference.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "dpr/smoothing.hpp"
#include "reference/priors.hpp"
#include "support/probe.hpp"
#include "support/reduced.hpp"
#include "support/worst.hpp"

namespace philox_test {

namespace {

using dpr::Buffer;
using dpr::test::device_impl;
using dpr::test::poison;
using dpr::test::Probe;
using dpr::test::Worst;
using RefPrior = dpr::reference::Prior;

using Words = std::array<cl_uint, 4>;

/// The words of a counter by itself, then those of a call for two, itself and the next.
std::array<cl_uint, 12> philox_calls(const Words& counter, cl_uint key0, cl_uint key1) {
  Probe probe({"philox.h"}, R"(
kernel void probe(const uint4 counter, const uint2 key, global uint* restrict out) {
  vstore4(philox4x32_10(counter, key), 0, out);
  vstore8(philox4x32_10_twice(counter, key), 0, out + 4);
})");
  Buffer<cl_uint> out;
  poison(out, 12, 0xdeadbeefU);
  probe(1, cl_uint4{{counter[0], counter[1], counter[2], counter[3]}}, cl_uint2{{key0, key1}}, out);
  std::array<cl_uint, 12> words{};
  out.download(words);
  return words;
}

/// The words of a counter, which come by themselves, in the first half of the call for two that names it, and
/// in the second half of that before.
Words philox(const Words& counter, cl_uint key0, cl_uint key1) {
  const std::array<cl_uint, 12> named = philox_calls(counter, key0, key1);
  const std::array<cl_uint, 12> before =
      philox_calls({counter[0], counter[1], counter[2] - 1, counter[3]}, key0, key1);
  CHECK(std::equal(named.begin(), named.begin() + 4, &named[4]));
  CHECK(std::equal(named.begin(), named.begin() + 4, &before[8]));
  return {named[0], named[1], named[2], named[3]};
}

std::string prior_option(RefPrior prior) {
  return " -DDPR_WIDTH=4 -DDPR_PRIOR=" + std::string(dpr::to_string(static_cast<dpr::Prior>(prior)));
}

/// Applies `function`, a float4 to float4 of priors.h, to a list whose length is a multiple of four.
std::vector<float> apply(RefPrior prior, const std::string& function, const std::vector<float>& in) {
  Probe probe({"shared_types.h", "lanes.h", "priors.h"}, R"(
kernel void probe(global const float* restrict in, global float* restrict out) {
  const uint i = (uint)get_global_id(0) * DPR_WIDTH;
  store_n()" + function + R"((DPR_PRIOR, load_n(i, in)), i, out);
})",
              prior_option(prior));
  const Buffer<float> in_buffer(device_impl(), std::span<const float>(in));
  Buffer<float> out;
  poison(out, in.size());
  probe(in.size() / 4, in_buffer, out);
  return out.download();
}

std::vector<float> uniforms(const std::vector<cl_uint>& bits) {
  Probe probe({"shared_types.h", "lanes.h", "priors.h"}, R"(
kernel void probe(global const uint* restrict in, global float* restrict out) {
  const uint i = (uint)get_global_id(0) * DPR_WIDTH;
  store_n(uniform_from_bits(load_n(i, in)), i, out);
})",
              prior_option(RefPrior::gaussian));
  const Buffer<cl_uint> in_buffer(device_impl(), std::span<const cl_uint>(bits));
  Buffer<float> out;
  poison(out, bits.size());
  probe(bits.size() / 4, in_buffer, out);
  return out.download();
}

/// Phi(x) from whichever tail keeps its digits.
long double normal_tail(long double x) { return 0.5L * std::erfc(-x / std::numbers::sqrt2_v<long double>); }

/// The x with Phi(x) = u, by bisection of the lower tail.
long double normal_quantile(long double u) {
  if (u > 0.5L) return -normal_quantile(1.0L - u);
  long double low = -20.0L, high = 0.0L;
  for (int i = 0; i < 90; ++i) {
    const long double middle = 0.5L * (low + high);
    (normal_tail(middle) < u ? low : high) = middle;
  }
  return 0.5L * (low + high);
}

long double quantile(RefPrior prior, long double u) {
  switch (prior) {
    case RefPrior::gaussian:
      return normal_quantile(u);
    case RefPrior::cauchy:
      return -1.0L / std::tan(std::numbers::pi_v<long double> * u);
    case RefPrior::logistic:
      return std::log(u) - std::log1p(-u);
    case RefPrior::gumbel:
      return -std::log(-std::log(u));
    case RefPrior::uniform:
      break;
  }
  return 0.0L;
}

/// Every u the generator can give near 0, near 1, and over the whole interval.
std::vector<float> uniform_grid() {
  std::vector<float> grid;
  const int count = dpr::test::reduced(2048, 8);
  const float step = 0x1p-23F, first = 0x1p-24F;
  for (int i = 0; i < count; ++i) grid.push_back(first + step * static_cast<float>(i));
  for (int i = 0; i < count; ++i) grid.push_back(1.0F - first - step * static_cast<float>(i));
  for (int i = 0; i < 4 * count; ++i) {
    grid.push_back((static_cast<float>(i) + 0.5F) / static_cast<float>(4 * count));
  }
  return grid;
}

struct SamplerCase {
  RefPrior prior;
  std::string_view name;
  double sample_tolerance, score_tolerance;
};

/// Twice the worst errors on the grid. Samples: |error| / max(1, |z|); scores: absolute where |nu'| < 1, else
/// relative. Measured: gaussian 3.1e-7 and 0, cauchy 2.3e-7 and 8.8e-8, logistic 1.7e-7 and 4.9e-8,
/// gumbel 1.6e-7 and 1.3e-7.
constexpr std::array<SamplerCase, 4> k_samplers{{{RefPrior::gaussian, "gaussian", 6e-7, 0.0},
                                                 {RefPrior::cauchy, "cauchy", 5e-7, 2e-7},
                                                 {RefPrior::logistic, "logistic", 4e-7, 1e-7},
                                                 {RefPrior::gumbel, "gumbel", 4e-7, 3e-7}}};

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("philox4x32-10: known answers") {
    CHECK(philox({0, 0, 0, 0}, 0, 0) == Words{0x6627e8d5U, 0xe169c58dU, 0xbc57ac4cU, 0x9b00dbd8U});
    const cl_uint ones = 0xffffffffU;
    CHECK(philox({ones, ones, ones, ones}, ones, ones) ==
          Words{0x408f276dU, 0x41c83b0eU, 0xa20bc7c6U, 0x6d5451fdU});
    // The digits of pi, from the generator's own test vectors.
    CHECK(philox({0x243f6a88U, 0x85a308d3U, 0x13198a2eU, 0x03707344U}, 0xa4093822U, 0x299f31d0U) ==
          Words{0xd16cfe09U, 0x94fdccebU, 0x5001e420U, 0x24126ea1U});
  }

  TEST_CASE("philox4x32-10: another counter or key gives other words") {
    const Words base = philox({1, 2, 3, 4}, 5, 6);
    CHECK(base != philox({1, 2, 3, 5}, 5, 6));
    CHECK(base != philox({1, 2, 3, 4}, 5, 7));
    CHECK(base == philox({1, 2, 3, 4}, 5, 6));
  }

  TEST_CASE("uniform_from_bits: never 0 or 1, increasing, symmetric") {
    const std::vector<cl_uint> bits{0U,          1U << 9U,    2U << 9U,    0x7fffffffU,
                                    0x80000000U, 0xfffffbffU, 0xfffffdffU, 0xffffffffU};
    const std::vector<float> u = uniforms(bits);
    for (std::size_t i = 0; i < u.size(); ++i) {
      CAPTURE(i);
      CHECK(u[i] > 0.0F);
      CHECK(u[i] < 1.0F);
      if (i > 0) CHECK(u[i] >= u[i - 1]);
    }
    CHECK(u.front() == 0x1p-24F);
    CHECK(u.back() == 1.0F - 0x1p-24F);
    CHECK(u[3] + u[4] == 1.0F);
  }

  TEST_CASE("samplers are the inverse CDFs") {
    const std::vector<float> grid = uniform_grid();
    for (const SamplerCase& c : k_samplers) {
      CAPTURE(std::string(c.name));
      const std::vector<float> found = apply(c.prior, "noise_quantile", grid);
      Worst worst, shifted;
      for (std::size_t i = 0; i < grid.size(); ++i) {
        const long double expected = quantile(c.prior, static_cast<long double>(grid[i]));
        const long double scale = std::max(1.0L, std::abs(expected));
        const auto error =
            static_cast<double>(std::abs(static_cast<long double>(found[i]) - expected) / scale);
        worst.add(error, "u", grid[i], "found", found[i], "expected", static_cast<double>(expected));
        shifted.add(
            static_cast<double>(std::abs(static_cast<long double>(found[i]) * 1.00001L - expected) / scale));
      }
      DPR_CHECK_WORST(worst, c.sample_tolerance);
      CHECK(shifted.error > c.sample_tolerance);  // a sampler wrong by 1e-5 is found out
    }
  }

  TEST_CASE("scores are the reference's") {
    std::vector<float> grid;
    const int count = dpr::test::reduced(1000, 4);
    for (int i = 0; i < 4 * count; ++i) {
      grid.push_back(15.0F * ((static_cast<float>(i) + 0.5F) / static_cast<float>(2 * count) - 1.0F));
    }
    for (const SamplerCase& c : k_samplers) {
      CAPTURE(std::string(c.name));
      std::vector<float> points = grid;
      // Gumbel's noise ends below -ln(ln 2^24) = -2.8: its score grows without bound there.
      if (c.prior == RefPrior::gumbel) {
        for (float& z : points) z = std::max(z, -3.0F);
      }
      const std::vector<float> found = apply(c.prior, "noise_score", points);
      Worst worst, turned;
      for (std::size_t i = 0; i < points.size(); ++i) {
        const double expected = dpr::reference::score(c.prior, static_cast<double>(points[i]));
        const double scale = std::max(1.0, std::abs(expected));
        worst.add(std::abs(static_cast<double>(found[i]) - expected) / scale, "z", points[i], "found",
                  found[i]);
        turned.add(std::abs(static_cast<double>(found[i]) + expected) / scale);
      }
      DPR_CHECK_WORST(worst, c.score_tolerance);
      CHECK(turned.error > c.score_tolerance);
    }
  }
}

}  // namespace philox_test
