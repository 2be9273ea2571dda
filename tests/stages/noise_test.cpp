// How noise is drawn: bounds, antithetic pairs, Latin hypercubes and their permutations.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "smoothing/priors.hpp"
#include "support/probe.hpp"
#include "support/reduced.hpp"

namespace noise_test {

namespace {

using dpr::test::device_impl;
using dpr::test::reduced;

/// The samples of faces 0, 1, ... in pixel 3 of view 1, drawn in blocks of `width`: uniform numbers, or the
/// noise of a prior.
std::vector<std::vector<float>> draw(cl_uint draws, cl_uint samples, std::size_t faces,
                                     std::optional<dpr::Prior> prior = {}, cl_uint seed = 7, int width = 8) {
  const std::string function = prior ? "draw_noise(s, " + std::string(to_string(*prior)) + ", name, block)"
                                     : "draw_uniform(s, name, block)";
  dpr::test::Probe probe({"shared_types.h", "philox.h", "lanes.h", "priors.h", "noise.h"}, R"(
kernel void probe(const uint samples, const uint draws, const uint seed, global float* restrict out) {
  const uint face = (uint)get_global_id(0);
  Sampling s;
  s.samples = samples;
  s.draws = draws;
  s.baseline = s.leave_out = 0.0f;
  s.seed_low = seed;
  s.seed_high = 0;
  const NoiseName name = name_noise(1, 3, face, DPR_STAGE_OCCUPANCY);
  for (uint block = 0; DPR_WIDTH * block < samples; ++block) {
    float lanes[DPR_WIDTH];
    store_n()" + function + R"(, 0, lanes);
    for (uint lane = 0; lane < DPR_WIDTH && DPR_WIDTH * block + lane < samples; ++lane) {
      out[face * samples + DPR_WIDTH * block + lane] = lanes[lane];
    }
  }
})",
                         " -DDPR_WIDTH=" + std::to_string(width));
  dpr::Buffer<float> out;
  dpr::test::poison(out, faces * samples);
  probe(faces, samples, draws, seed, out);
  const std::vector<float> all = out.download();
  std::vector<std::vector<float>> by_face;
  for (std::size_t f = 0; f < faces; ++f) {
    const auto first = all.begin() + static_cast<std::ptrdiff_t>(f * samples);
    by_face.emplace_back(first, first + samples);
  }
  return by_face;
}

/// The stratum of every sample.
std::vector<std::size_t> strata(const std::vector<float>& us) {
  std::vector<std::size_t> indices;
  for (const float u : us) {
    indices.push_back(static_cast<std::size_t>(static_cast<double>(u) * static_cast<double>(us.size())));
  }
  return indices;
}

bool is_permutation(std::vector<std::size_t> indices) {
  std::sort(indices.begin(), indices.end());
  for (std::size_t i = 0; i < indices.size(); ++i) {
    if (indices[i] != i) return false;
  }
  return true;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("antithetic draws come in pairs u and 1 - u, the pairs independent") {
    for (const auto& us : draw(DPR_ANTITHETIC, 22, 4)) {
      for (std::size_t i = 0; i < us.size(); i += 2) {
        CHECK(us[i] + us[i + 1] == 1.0F);
        for (std::size_t j = 0; j < i; ++j) CHECK(us[i] != us[j]);
      }
    }
    for (const dpr::PriorRow& row : dpr::priors()) {
      if (!row.has_score() || !row.is_symmetric()) continue;
      for (const auto& zs : draw(DPR_ANTITHETIC, 8, 4, row.prior)) {
        for (std::size_t i = 0; i < zs.size(); i += 2) CHECK(zs[i] == -zs[i + 1]);
      }
    }
  }

  TEST_CASE("stratified draws fall once into every stratum, for any number of samples") {
    for (const cl_uint samples : {1U, 2U, 3U, 7U, 8U, 9U, 20U, 64U, 100U}) {
      CAPTURE(samples);
      for (const auto& us : draw(DPR_STRATIFIED, samples, 6)) {
        CHECK(is_permutation(strata(us)));
        for (const float u : us) CHECK((u > 0.0F && u < 1.0F));
      }
    }
    for (const auto& us : draw(DPR_INDEPENDENT, 20, 6)) CHECK_FALSE(is_permutation(strata(us)));
  }

  TEST_CASE("blocks of four and of eight hold the same samples") {
    for (const cl_uint draws : {DPR_INDEPENDENT, DPR_ANTITHETIC, DPR_STRATIFIED}) {
      CAPTURE(draws);
      CHECK(draw(draws, 22, 4) == draw(draws, 22, 4, {}, 7, 4));
    }
  }

  TEST_CASE("noise stays within the bounds that skip work") {
    // The uniform numbers furthest out, whatever the draws.
    const std::vector<float> ends{0x1p-24F, 1.0F - 0x1p-24F};
    for (const std::string_view name : dpr::scored_priors()) {
      const std::string prior(name);
      CAPTURE(prior);
      dpr::test::Probe probe({"shared_types.h", "philox.h", "lanes.h", "priors.h", "noise.h"}, R"(
kernel void probe(global const float* restrict u, global float* restrict out) {
  out[0] = noise_quantile(DPR_PRIOR, (realn)(u[0])).s0 - lowest_noise(DPR_PRIOR);
  out[1] = highest_noise(DPR_PRIOR) - noise_quantile(DPR_PRIOR, (realn)(u[1])).s0;
})",
                             " -DDPR_WIDTH=8 -DDPR_PRIOR=" + prior);
      const dpr::Buffer<float> in(device_impl(), std::span<const float>(ends));
      dpr::Buffer<float> out;
      dpr::test::poison(out, 2);
      probe(1, in, out);
      for (const float margin : out.download()) {
        CHECK(margin > 0.0F);
        CHECK(margin < (prior == "cauchy" ? 1e5F : 0.1F));
      }
    }
  }
}

TEST_SUITE("statistical") {
  TEST_CASE(
      "stratified draws: permutations of different faces are independent, and reach every pair of strata") {
    constexpr cl_uint k_samples = 5;
    const auto faces = static_cast<std::size_t>(reduced(20000, 64));
    const auto all = draw(DPR_STRATIFIED, k_samples, 2 * faces);
    // How often sample 0 of one face and of the next fall into each pair of strata, and how often samples 0
    // and 1 of one face do: uniform over 25 pairs, and near it over the 20 of different strata.
    std::vector<double> across(k_samples * k_samples), within(k_samples * k_samples);
    for (std::size_t f = 0; f < faces; ++f) {
      const auto a = strata(all[2 * f]), b = strata(all[2 * f + 1]);
      across[a[0] * k_samples + b[0]] += 1;
      within[a[0] * k_samples + a[1]] += 1;
    }
    if (dpr::test::is_reduced()) return;
    const auto count = static_cast<double>(faces);
    double chi_across = 0;
    for (std::size_t i = 0; i < across.size(); ++i) {
      chi_across += std::pow(across[i] - count / 25, 2) / (count / 25);
      // The hash prefers some permutations; the variance does not suffer (see permute).
      const double wanted = i % (k_samples + 1) == 0 ? 0 : count / 20;
      CHECK(std::abs(within[i] - wanted) <= 0.3 * wanted);
    }
    // Chi-squared of 24 degrees of freedom: four deviations are 28.
    CHECK(chi_across < 24 + 28);
  }

  TEST_CASE("the jitter within a stratum is uniform") {
    double sum = 0, squares = 0;
    std::size_t count = 0;
    for (const auto& us : draw(DPR_STRATIFIED, 7, static_cast<std::size_t>(reduced(4000, 16)))) {
      for (const float u : us) {
        const double jitter = static_cast<double>(u) * 7 - std::floor(static_cast<double>(u) * 7);
        sum += jitter;
        squares += jitter * jitter;
        ++count;
      }
    }
    const auto n = static_cast<double>(count);
    CHECK(std::abs(sum / n - 0.5) < 4 * std::sqrt(1.0 / 12 / n));
    CHECK(std::abs(squares / n - 1.0 / 3) < 4 * std::sqrt(4.0 / 45 / n));
  }
}

}  // namespace noise_test
