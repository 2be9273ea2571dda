#include "experiments/pose/score_estimator.hpp"

#include <cmath>
#include <numeric>
#include <string>
#include <utility>

#include "base/checks.hpp"
#include "dpr/error.hpp"
#include "smoothing/choice_names.hpp"
#include "smoothing/priors.hpp"

namespace dpr::bench {
namespace {

constexpr std::uint32_t k_most_draws = 4096;

/// Purpose of a random word: the third word of its counter.
enum Purpose : std::uint32_t { sampling, shuffling };

/// A number in (0, 1), never 0 or 1, from 52 random bits.
double random_uniform(std::uint64_t seed, std::uint32_t item, std::uint32_t dimension, Purpose purpose) {
  const auto words = philox4x32_10({item, dimension, purpose, 0}, {static_cast<std::uint32_t>(seed),
                                                                   static_cast<std::uint32_t>(seed >> 32U)});
  const std::uint64_t bits = (std::uint64_t{words[0]} << 32U | words[1]) >> 12U;
  return (static_cast<double>(bits) + 0.5) * 0x1p-52;
}

/// A random order of the strata (Fisher & Yates 1938).
std::vector<std::uint32_t> shuffled_strata(std::uint64_t seed, std::uint32_t count, std::uint32_t dimension) {
  std::vector<std::uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0U);
  for (std::uint32_t i = count - 1; i > 0; --i) {
    const double u = random_uniform(seed, i, dimension, shuffling);
    std::swap(order[i], order[static_cast<std::uint32_t>(u * (i + 1.0))]);
  }
  return order;
}

/// Samples that depend on each other lie together: pairs, or one.
std::uint32_t group_size(Draws draws) { return draws == Draws::antithetic ? 2 : 1; }

/// Mean and standard error of the groups' means.
Estimate mean_of_groups(std::span<const double> terms, std::size_t size) {
  const auto groups = static_cast<double>(terms.size() / size);
  Estimate result;
  result.value = std::accumulate(terms.begin(), terms.end(), 0.0) / static_cast<double>(terms.size());
  double squares = 0;
  for (std::size_t first = 0; first < terms.size(); first += size) {
    const double sum = std::accumulate(terms.begin() + static_cast<std::ptrdiff_t>(first),
                                       terms.begin() + static_cast<std::ptrdiff_t>(first + size), 0.0);
    squares += std::pow(sum / static_cast<double>(size) - result.value, 2);
  }
  if (groups > 1) result.error = std::sqrt(squares / (groups - 1) / groups);
  return result;
}

/// f - baseline. Leave-one-out leaves out the whole group: the mean over a set that holds the sample's own
/// mirror image depends on its noise, and the estimator would be biased.
std::vector<double> excesses(const NoiseOptions& options, std::span<const double> values, double rigid) {
  std::vector<double> excess(values.begin(), values.end());
  if (options.variance_reduction == VarianceReduction::rigid) {
    for (double& e : excess) e -= rigid;
  }
  if (options.variance_reduction != VarianceReduction::leave_one_out) return excess;
  const std::size_t size = group_size(options.draws);
  const double total = std::accumulate(values.begin(), values.end(), 0.0);
  for (std::size_t first = 0; first < values.size(); first += size) {
    double group = 0;
    for (std::size_t i = first; i < first + size; ++i) group += values[i];
    const double mean_of_others = (total - group) / static_cast<double>(values.size() - size);
    for (std::size_t i = first; i < first + size; ++i) excess[i] -= mean_of_others;
  }
  return excess;
}

}  // namespace

std::array<std::uint32_t, 4> philox4x32_10(std::array<std::uint32_t, 4> counter,
                                           std::array<std::uint32_t, 2> key) {
  constexpr int k_rounds = 10;
  constexpr std::uint64_t k_multiplier0 = 0xD2511F53, k_multiplier1 = 0xCD9E8D57;
  constexpr std::uint32_t k_weyl0 = 0x9E3779B9, k_weyl1 = 0xBB67AE85;
  for (int round = 0; round < k_rounds; ++round) {
    const std::uint64_t first = k_multiplier0 * counter[0], second = k_multiplier1 * counter[2];
    counter = {
        static_cast<std::uint32_t>(second >> 32U) ^ counter[1] ^ key[0], static_cast<std::uint32_t>(second),
        static_cast<std::uint32_t>(first >> 32U) ^ counter[3] ^ key[1], static_cast<std::uint32_t>(first)};
    key = {key[0] + k_weyl0, key[1] + k_weyl1};
  }
  return counter;
}

void validate(const NoiseOptions& options) {
  require(options.samples >= 1 && options.samples <= k_most_draws, "samples (perturbed pose)",
          options.samples, "1 to 4096");
  const PriorRow& prior = row_of(options.prior);
  if (!prior.has_score()) {
    const std::string name(prior.name);
    throw InvalidArgument("prior (perturbed pose)", name,
                          one_of(scored_priors()) + ": the " + name + " density has no score");
  }
  if (options.draws == Draws::antithetic) {
    require(options.samples % 2 == 0, "samples (perturbed pose)", options.samples,
            "an even number, for antithetic pairs");
    if (!prior.is_symmetric()) {
      throw InvalidArgument("draws (perturbed pose)",
                            "antithetic with the " + std::string(prior.name) + " prior",
                            "a symmetric prior, or independent or stratified draws");
    }
  }
  if (options.variance_reduction != VarianceReduction::leave_one_out) return;
  if (options.draws == Draws::stratified) {
    throw InvalidArgument("variance_reduction (perturbed pose)", "leave_one_out with stratified draws",
                          "none or rigid: no sample of a Latin hypercube is independent of the others");
  }
  require(options.samples >= 2 * group_size(options.draws), "samples (perturbed pose)", options.samples,
          "at least two independent draws, or two pairs, for leave_one_out");
}

std::vector<double> draw_noise(const NoiseOptions& options, std::size_t dimensions) {
  const std::uint32_t samples = options.samples, size = group_size(options.draws);
  std::vector<double> noise(samples * dimensions);
  for (std::uint32_t k = 0; k < dimensions; ++k) {
    std::vector<std::uint32_t> strata;
    if (options.draws == Draws::stratified) strata = shuffled_strata(options.seed, samples, k);
    for (std::uint32_t m = 0; m < samples; ++m) {
      double u = random_uniform(options.seed, m / size, k, sampling);
      if (!strata.empty()) u = (strata[m] + u) / samples;
      const double z = quantile(options.prior, u);
      noise[m * dimensions + k] = m % size == 0 ? z : -z;
    }
  }
  return noise;
}

ScoreEstimate estimate(const NoiseOptions& options, std::span<const double> values,
                       std::span<const double> noise, double rigid) {
  const std::size_t samples = values.size(), dimensions = noise.size() / samples;
  const std::size_t size = group_size(options.draws);
  const std::vector<double> excess = excesses(options, values, rigid);
  const auto score = row_of(options.prior).score;

  ScoreEstimate result;
  result.value = mean_of_groups(values, size);
  std::vector<double> terms(samples);
  for (std::size_t k = 0; k < dimensions; ++k) {
    for (std::size_t m = 0; m < samples; ++m) {
      terms[m] = excess[m] * score(noise[m * dimensions + k]);
    }
    result.gradient.push_back(mean_of_groups(terms, size));
  }
  for (std::size_t m = 0; m < samples; ++m) {
    // The determinant of the change of variables is scale^-d: hence -1 for every dimension.
    double sum = 0;
    for (std::size_t k = 0; k < dimensions; ++k) {
      const double z = noise[m * dimensions + k];
      sum += score(z) * z - 1;
    }
    terms[m] = excess[m] * sum;
  }
  result.sensitivity = mean_of_groups(terms, size);
  return result;
}

}  // namespace dpr::bench
