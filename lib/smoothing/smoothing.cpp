// The smoothing: its words, its named members, its checks, and how far it reaches.
#include "dpr/smoothing.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string>

#include "base/checks.hpp"
#include "smoothing/prior_functions.hpp"

namespace dpr {
namespace {

constexpr std::uint32_t k_most_samples = 1U << 20U;
/// Where the Cauchy prior's radius ends, in sigmas: its tail would reach 3,183 of them at a threshold of
/// 1e-4.
constexpr double k_cauchy_reach = 100;

template <typename Enum>
struct Word {
  Enum value;
  std::string_view name;
};

constexpr std::array<Word<Prior>, 5> k_priors{{{Prior::gaussian, "gaussian"},
                                               {Prior::cauchy, "cauchy"},
                                               {Prior::logistic, "logistic"},
                                               {Prior::gumbel, "gumbel"},
                                               {Prior::uniform, "uniform"}}};
constexpr std::array<Word<Composition>, 2> k_compositions{
    {{Composition::barrier, "barrier"}, {Composition::joint, "joint"}}};
constexpr std::array<Word<Estimator>, 2> k_estimators{
    {{Estimator::exact, "exact"}, {Estimator::monte_carlo, "monte_carlo"}}};
constexpr std::array<Word<VarianceReduction>, 3> k_variance_reductions{
    {{VarianceReduction::none, "none"},
     {VarianceReduction::rigid, "rigid"},
     {VarianceReduction::leave_one_out, "leave_one_out"}}};
constexpr std::array<Word<Draws>, 3> k_draws{{{Draws::independent, "independent"},
                                              {Draws::antithetic, "antithetic"},
                                              {Draws::stratified, "stratified"}}};
constexpr std::array<Word<DistanceMetric>, 2> k_distance_metrics{
    {{DistanceMetric::squared, "squared"}, {DistanceMetric::euclidean, "euclidean"}}};
constexpr std::array<Word<OccupancyWidth>, 2> k_occupancy_widths{
    {{OccupancyWidth::fixed, "fixed"}, {OccupancyWidth::variable, "variable"}}};

template <typename Enum>
std::string choices(std::span<const Word<Enum>> words) {
  std::string list;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (i > 0) list += i + 1 < words.size() ? ", " : " or ";
    list += words[i].name;
  }
  return list;
}

template <typename Enum>
std::string_view find_name(std::span<const Word<Enum>> words, Enum value) {
  for (const Word<Enum>& word : words) {
    if (word.value == value) return word.name;
  }
  return {};
}

template <typename Enum>
Enum find_value(std::span<const Word<Enum>> words, std::string_view name, std::string_view where) {
  for (const Word<Enum>& word : words) {
    if (word.name == name) return word.value;
  }
  throw InvalidArgument(std::string(where), "\"" + std::string(name) + "\"", choices(words));
}

template <typename Enum>
void require_known(std::span<const Word<Enum>> words, Enum value, const std::string& argument) {
  if (find_name(words, value).empty()) {
    throw InvalidArgument(argument, std::to_string(static_cast<int>(value)), choices(words));
  }
}

void validate_words(const Smoothing& s) {
  require_known<Prior>(k_priors, s.occupancy_prior, "occupancy_prior (smoothing)");
  require_known<Prior>(k_priors, s.depth_prior, "depth_prior (smoothing)");
  require_known<Composition>(k_compositions, s.composition, "composition (smoothing)");
  require_known<Estimator>(k_estimators, s.occupancy_estimator, "occupancy_estimator (smoothing)");
  require_known<Estimator>(k_estimators, s.aggregation_estimator, "aggregation_estimator (smoothing)");
  require_known<VarianceReduction>(k_variance_reductions, s.variance_reduction,
                                   "variance_reduction (smoothing)");
  require_known<Draws>(k_draws, s.draws, "draws (smoothing)");
  require_known<DistanceMetric>(k_distance_metrics, s.distance, "distance (smoothing)");
  require_known<OccupancyWidth>(k_occupancy_widths, s.occupancy_width, "occupancy_width (smoothing)");
}

/// What a sampled stage asks of its prior.
void validate_sampled_prior(Prior prior, Draws draws, const std::string& stage) {
  if (prior == Prior::uniform) {
    throw InvalidArgument(stage + "_estimator (smoothing)", "monte_carlo with the uniform prior",
                          "exact: the uniform density has no score, so its gradient cannot be sampled");
  }
  if (prior == Prior::gumbel && draws == Draws::antithetic) {
    throw InvalidArgument("draws (smoothing)", "antithetic with the gumbel prior of the " + stage,
                          "independent or stratified: Gumbel's density is not symmetric");
  }
}

/// Which baselines, draws and numbers of samples make an unbiased estimator.
void validate_sampling(const Smoothing& s) {
  const bool paired = s.draws == Draws::antithetic;
  if (paired && s.samples % 2 != 0) {
    throw InvalidArgument("samples (smoothing)", checks::text(s.samples) + " with antithetic draws",
                          "an even number: antithetic draws come in pairs");
  }
  if (s.variance_reduction != VarianceReduction::leave_one_out) return;
  if (s.draws == Draws::stratified) {
    throw InvalidArgument("variance_reduction (smoothing)",
                          "leave_one_out (the default) with stratified draws",
                          "none or rigid: stratified samples are not independent of each other");
  }
  const std::uint32_t least = paired ? 4 : 2;
  if (s.samples < least) {
    throw InvalidArgument("samples (smoothing)", checks::text(s.samples) + " with leave_one_out",
                          "at least " + checks::text(least) + ", so that samples are left" +
                              (paired ? " beside an antithetic pair" : ""));
  }
}

void validate_estimators(const Smoothing& s) {
  const bool occupancy = s.occupancy_estimator == Estimator::monte_carlo;
  const bool aggregation = s.aggregation_estimator == Estimator::monte_carlo;
  if (s.composition == Composition::joint && occupancy != aggregation) {
    throw InvalidArgument(std::string(occupancy ? "occupancy" : "aggregation") + "_estimator (smoothing)",
                          "monte_carlo beside an exact stage in the joint composition",
                          "the same for both: a sample perturbs distances and depths together");
  }
  if (occupancy) validate_sampled_prior(s.occupancy_prior, s.draws, "occupancy");
  if (aggregation) validate_sampled_prior(s.depth_prior, s.draws, "aggregation");
  if (occupancy || aggregation) validate_sampling(s);
}

void validate_width(const Smoothing& s) {
  if (s.occupancy_width == OccupancyWidth::fixed) return;
  const auto require_with = [](bool ok, const char* with, const char* expected) {
    if (!ok) {
      throw InvalidArgument("occupancy_width (smoothing)", std::string("variable with ") + with,
                            std::string("variable with ") + expected + ", or fixed");
    }
  };
  require_with(s.occupancy_prior == Prior::uniform, "another prior", "the uniform occupancy_prior");
  require_with(s.occupancy_estimator == Estimator::exact, "monte_carlo", "the exact occupancy_estimator");
  require_with(s.distance == DistanceMetric::euclidean, "squared distances", "euclidean distances");
  require_with(s.composition == Composition::joint, "the barrier", "the joint composition");
  require_with(s.blur_radius.has_value(), "no blur_radius", "a blur_radius");
}

// x with P(X > x) = tail, in units of sigma: there the occupancy of a pixel outside by x has fallen to
// `tail`.
double reach(Prior prior, double tail) {
  const double x = upper_quantile(prior, tail);
  return prior == Prior::cauchy ? std::min(x, k_cauchy_reach) : x;
}

// The blur radius of SoftRas, of PyTorch3D and of the published program: where the logistic occupancy is
// 1e-4.
float published_blur_radius(float sigma) {
  return static_cast<float>(reach(Prior::logistic, 1e-4) * static_cast<double>(sigma));  // 9.21 sigma
}

Smoothing softras() {
  Smoothing smoothing;
  smoothing.occupancy_prior = Prior::logistic;
  smoothing.depth_prior = Prior::gumbel;
  smoothing.blur_radius = published_blur_radius(smoothing.sigma);
  return smoothing;
}

Smoothing published(Prior prior) {
  Smoothing smoothing;
  smoothing.occupancy_prior = smoothing.depth_prior = prior;
  smoothing.occupancy_estimator = smoothing.aggregation_estimator = Estimator::monte_carlo;
  smoothing.samples = 8;
  smoothing.variance_reduction = VarianceReduction::rigid;
  smoothing.blur_radius = published_blur_radius(smoothing.sigma);
  return smoothing;
}

Smoothing joint_gaussian() {
  Smoothing smoothing;
  smoothing.composition = Composition::joint;
  return smoothing;
}

// Rigid depths under uniform noise on the distances.
Smoothing uniform_edges(float sigma) {
  Smoothing smoothing = rigid_smoothing();
  smoothing.occupancy_prior = Prior::uniform;
  smoothing.distance = DistanceMetric::euclidean;
  smoothing.sigma = sigma;
  smoothing.blur_radius.reset();
  return smoothing;
}

Smoothing opendr(int width, int height) {
  return uniform_edges(2.0F / static_cast<float>(std::min(width, height)));
}

Smoothing nmr() {
  constexpr float k_published_epsilon = 1e-3F, k_reach = 0.5F;  // NDC
  Smoothing smoothing = uniform_edges(k_published_epsilon);
  smoothing.occupancy_width = OccupancyWidth::variable;
  smoothing.blur_radius = k_reach;
  return smoothing;
}

}  // namespace

void validate(const Smoothing& smoothing) {
  validate_words(smoothing);
  checks::require_positive(smoothing.sigma, "sigma (smoothing)");
  checks::require_positive(smoothing.gamma, "gamma (smoothing)");
  checks::require_positive(smoothing.alpha, "alpha (smoothing)");
  if (smoothing.samples < 1 || smoothing.samples > k_most_samples) {
    throw InvalidArgument("samples (smoothing)", checks::text(smoothing.samples),
                          "a whole number from 1 to " + checks::text(k_most_samples));
  }
  if (!(smoothing.occupancy_threshold > 0 && smoothing.occupancy_threshold < 0.5F)) {
    throw InvalidArgument("occupancy_threshold (smoothing)", checks::text(smoothing.occupancy_threshold),
                          "a number between 0 and 0.5, both excluded");
  }
  if (smoothing.blur_radius && !(*smoothing.blur_radius >= 0 && std::isfinite(*smoothing.blur_radius))) {
    throw InvalidArgument("blur_radius (smoothing)", checks::text(*smoothing.blur_radius),
                          "a finite number >= 0");
  }
  checks::require_finite(smoothing.background_depth, "background_depth (smoothing)");
  validate_width(smoothing);
  validate_estimators(smoothing);
}

float blur_radius(const Smoothing& smoothing) {
  if (smoothing.blur_radius) return *smoothing.blur_radius;
  const double tail = static_cast<double>(smoothing.occupancy_threshold);
  return static_cast<float>(reach(smoothing.occupancy_prior, tail) * static_cast<double>(smoothing.sigma));
}

Smoothing rigid_smoothing() {
  Smoothing smoothing;
  smoothing.composition = Composition::joint;
  smoothing.sigma = 1e-12F;  // far below the square of a pixel's width: p is 0 or 1
  smoothing.gamma = 1e-9F;   // far below the spacing of single-precision depths: the nearest triangle wins
  smoothing.blur_radius = 0.0F;
  return smoothing;
}

Smoothing smoothing_preset(std::string_view name, int width, int height) {
  if (width < 1 || height < 1) {
    throw InvalidArgument("size (preset)", checks::text(width) + "x" + checks::text(height), "at least 1x1");
  }
  if (name == "softras") return softras();
  if (name == "opendr") return opendr(width, height);
  if (name == "nmr") return nmr();
  if (name == "paper_gaussian") return published(Prior::gaussian);
  if (name == "paper_cauchy") return published(Prior::cauchy);
  if (name == "gaussian") return Smoothing{};
  if (name == "joint_gaussian") return joint_gaussian();
  if (name == "rigid") return rigid_smoothing();
  throw InvalidArgument(
      "preset (smoothing)", "\"" + std::string(name) + "\"",
      "softras, opendr, nmr, paper_gaussian, paper_cauchy, gaussian, joint_gaussian or rigid");
}

std::string_view to_string(Prior value) { return find_name<Prior>(k_priors, value); }
std::string_view to_string(Composition value) { return find_name<Composition>(k_compositions, value); }
std::string_view to_string(Estimator value) { return find_name<Estimator>(k_estimators, value); }
std::string_view to_string(VarianceReduction value) {
  return find_name<VarianceReduction>(k_variance_reductions, value);
}
std::string_view to_string(Draws value) { return find_name<Draws>(k_draws, value); }
std::string_view to_string(DistanceMetric value) {
  return find_name<DistanceMetric>(k_distance_metrics, value);
}
std::string_view to_string(OccupancyWidth value) {
  return find_name<OccupancyWidth>(k_occupancy_widths, value);
}

Prior parse_prior(std::string_view word, std::string_view where) {
  return find_value<Prior>(k_priors, word, where);
}
Composition parse_composition(std::string_view word, std::string_view where) {
  return find_value<Composition>(k_compositions, word, where);
}
Estimator parse_estimator(std::string_view word, std::string_view where) {
  return find_value<Estimator>(k_estimators, word, where);
}
VarianceReduction parse_variance_reduction(std::string_view word, std::string_view where) {
  return find_value<VarianceReduction>(k_variance_reductions, word, where);
}
Draws parse_draws(std::string_view word, std::string_view where) {
  return find_value<Draws>(k_draws, word, where);
}
DistanceMetric parse_distance_metric(std::string_view word, std::string_view where) {
  return find_value<DistanceMetric>(k_distance_metrics, word, where);
}
OccupancyWidth parse_occupancy_width(std::string_view word, std::string_view where) {
  return find_value<OccupancyWidth>(k_occupancy_widths, word, where);
}

}  // namespace dpr
