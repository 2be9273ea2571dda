// The one way from what is said of a smoothing to a smoothing.
#include "dpr/smoothing_options.hpp"

#include "smoothing/option_fields.hpp"

namespace dpr {
namespace {

template <typename Value>
void take(const std::optional<Value>& given, Value& value) {
  if (given) value = *given;
}

/// Sigma, and the blur radius that follows it.
void take_reach(const SmoothingOptions& given, Smoothing& smoothing) {
  if (given.sigma) set_sigma(smoothing, *given.sigma);
  take(given.occupancy_threshold, smoothing.occupancy_threshold);
  take(given.occupancy_width, smoothing.occupancy_width);
  take(given.noise, smoothing.noise);
  const bool needs_radius = smoothing.occupancy_width == OccupancyWidth::variable;
  if (given.occupancy_threshold && !needs_radius) smoothing.blur_radius.reset();
  if (smoothing.noise == Noise::pixel) smoothing.blur_radius.reset();
  if (given.blur_radius) smoothing.blur_radius = given.blur_radius;
}

void take_estimators(const SmoothingOptions& given, Smoothing& smoothing) {
  take(given.estimator, smoothing.occupancy_estimator);
  take(given.estimator, smoothing.aggregation_estimator);
  take(given.occupancy_estimator, smoothing.occupancy_estimator);
  take(given.aggregation_estimator, smoothing.aggregation_estimator);
}

/// The smoothing that the options start from.
Smoothing basis(const SmoothingOptions& given, int width, int height,
                const std::optional<Smoothing>& otherwise) {
  if (given.preset) {
    Smoothing smoothing = smoothing_preset(*given.preset, width, height);
    if (otherwise) smoothing.seed = otherwise->seed;
    return smoothing;
  }
  if (otherwise) return *otherwise;
  const bool of_pixel = says_nothing(given) || given.noise == Noise::pixel;
  return smoothing_preset(of_pixel ? "pixel" : "gaussian");
}

}  // namespace

Smoothing resolve_smoothing(const SmoothingOptions& given, int width, int height,
                            const std::optional<Smoothing>& otherwise) {
  Smoothing smoothing = basis(given, width, height, otherwise);
  take(given.occupancy_prior, smoothing.occupancy_prior);
  take(given.depth_prior, smoothing.depth_prior);
  take_reach(given, smoothing);
  take(given.gamma, smoothing.gamma);
  take(given.alpha, smoothing.alpha);
  take(given.composition, smoothing.composition);
  take_estimators(given, smoothing);
  take(given.samples, smoothing.samples);
  take(given.variance_reduction, smoothing.variance_reduction);
  take(given.draws, smoothing.draws);
  take(given.seed, smoothing.seed);
  take(given.background_depth, smoothing.background_depth);
  take(given.distance, smoothing.distance);
  take(given.supersampling, smoothing.supersampling);
  validate(smoothing);
  return smoothing;
}

bool says_nothing(const SmoothingOptions& given) {
  return given == SmoothingOptions{.seed = given.seed, .supersampling = given.supersampling};
}

SmoothingOptions overlay(const SmoothingOptions& under, const SmoothingOptions& over) {
  SmoothingOptions merged = under;
  if (over.preset) {
    merged = {};
    merged.seed = under.seed;
  }
  if (over.estimator) {
    merged.occupancy_estimator.reset();
    merged.aggregation_estimator.reset();
  }
  for_each_option([&](auto, auto, auto member) {
    if (over.*member) merged.*member = over.*member;
  });
  return merged;
}

}  // namespace dpr
