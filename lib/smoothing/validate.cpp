// Smoothings that there are estimators for, and the ranges of their numbers.
#include <cmath>
#include <string>

#include "base/checks.hpp"
#include "smoothing/choice_names.hpp"
#include "smoothing/priors.hpp"

namespace dpr {
namespace {

constexpr std::uint32_t k_most_samples = 1U << 20U;

template <SmoothingChoice Choice>
void require_known(Choice value, const std::string& argument) {
  if (to_string(value).empty()) {
    throw InvalidArgument(argument, std::to_string(static_cast<int>(value)),
                          one_of(names_of_choices<Choice>()));
  }
}

void validate_choices(const Smoothing& s) {
  require_known(s.occupancy_prior, "occupancy_prior (smoothing)");
  require_known(s.depth_prior, "depth_prior (smoothing)");
  require_known(s.composition, "composition (smoothing)");
  require_known(s.occupancy_estimator, "occupancy_estimator (smoothing)");
  require_known(s.aggregation_estimator, "aggregation_estimator (smoothing)");
  require_known(s.variance_reduction, "variance_reduction (smoothing)");
  require_known(s.draws, "draws (smoothing)");
  require_known(s.distance, "distance (smoothing)");
  require_known(s.occupancy_width, "occupancy_width (smoothing)");
  require_known(s.noise, "noise (smoothing)");
}

/// Checks that a sampled stage can draw from its prior.
void validate_sampled_prior(Prior prior, Draws draws, const std::string& stage) {
  const PriorRow& row = row_of(prior);
  const std::string name(row.name);
  if (!row.has_score()) {
    throw InvalidArgument(stage + "_estimator (smoothing)", "monte_carlo with the " + name + " prior",
                          "exact: the " + name + " density has no score, so its gradient cannot be sampled");
  }
  if (!row.is_symmetric() && draws == Draws::antithetic) {
    throw InvalidArgument("draws (smoothing)", "antithetic with the " + name + " prior of the " + stage,
                          "independent or stratified: the " + name + " density is not symmetric");
  }
}

/// Baselines, draws and numbers of samples that make an unbiased estimator.
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
  const bool of_triangles = s.noise == Noise::triangle;
  if (of_triangles && s.composition == Composition::joint && occupancy != aggregation) {
    throw InvalidArgument(std::string(occupancy ? "occupancy" : "aggregation") + "_estimator (smoothing)",
                          "monte_carlo beside an exact stage in the joint composition",
                          "the same for both: a sample perturbs distances and depths together");
  }
  if (occupancy && of_triangles) validate_sampled_prior(s.occupancy_prior, s.draws, "occupancy");
  if (aggregation) validate_sampled_prior(s.depth_prior, s.draws, "aggregation");
  if (occupancy || aggregation) validate_sampling(s);
}

void validate_width(const Smoothing& s) {
  if (s.occupancy_width == OccupancyWidth::zero && s.occupancy_estimator != Estimator::exact) {
    throw InvalidArgument("occupancy_width (smoothing)", "zero with monte_carlo",
                          "zero with the exact occupancy_estimator, or fixed");
  }
  if (s.occupancy_width != OccupancyWidth::variable) return;
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

/// Checks that noise of the pixel is combined with members that support it.
void validate_noise(const Smoothing& s) {
  const bool known = s.supersampling == 1 || s.supersampling == 2 || s.supersampling == 4;
  if (!known || (s.noise == Noise::triangle && s.supersampling != 1)) {
    throw InvalidArgument("supersampling (smoothing)", checks::text(s.supersampling),
                          known ? "1, or noise of the pixel" : "1, 2 or 4");
  }
  if (s.noise == Noise::triangle) return;
  const auto require_with = [](bool ok, const std::string& with, const char* expected) {
    if (!ok)
      throw InvalidArgument("noise (smoothing)", "pixel with " + with,
                            std::string("pixel with ") + expected + ", or triangle");
  };
  require_with(row_of(s.occupancy_prior).is_symmetric(),
               std::string("the ") + std::string(row_of(s.occupancy_prior).name) + " occupancy_prior",
               "a symmetric one, which does not shift the image");
  require_with(s.occupancy_width == OccupancyWidth::fixed,
               std::string("occupancy_width ") + std::string(to_string(s.occupancy_width)),
               "occupancy_width fixed, as preset pixel has it");
  require_with(!s.blur_radius, "a blur_radius", "none: no triangle is blurred");
}

/// Single precision holds the inverses of these, and what they multiply.
void require_scale(float value, const std::string& argument) {
  checks::require_positive(value, argument);
  if (value >= 1e-36F && value <= 1e36F) return;
  throw InvalidArgument(argument, checks::text(value),
                        "a number from 1e-36 to 1e36, whose inverse single precision holds");
}

}  // namespace

bool is_sampled(const Smoothing& smoothing) {
  return smoothing.occupancy_estimator == Estimator::monte_carlo ||
         smoothing.aggregation_estimator == Estimator::monte_carlo;
}

void validate(const Smoothing& smoothing) {
  validate_choices(smoothing);
  require_scale(smoothing.sigma, "sigma (smoothing)");
  require_scale(smoothing.gamma, "gamma (smoothing)");
  require_scale(smoothing.alpha, "alpha (smoothing)");
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
  validate_noise(smoothing);
  validate_width(smoothing);
  validate_estimators(smoothing);
}

}  // namespace dpr
