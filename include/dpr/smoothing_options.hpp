// A smoothing as people describe it: some of its values, by name, and the rest to follow from them.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "dpr/export.h"
#include "dpr/smoothing.hpp"

namespace dpr {

/// Members of a smoothing that a file, a command line or a caller gives; resolve_smoothing() finds the rest.
struct SmoothingOptions {
  std::optional<std::string> preset = {};
  std::optional<Prior> occupancy_prior = {}, depth_prior = {};
  std::optional<float> sigma = {}, gamma = {}, alpha = {};
  std::optional<Composition> composition = {};
  std::optional<Estimator> estimator = {};  ///< of both stages; the next two override it for one
  std::optional<Estimator> occupancy_estimator = {}, aggregation_estimator = {};
  std::optional<std::uint32_t> samples = {};
  std::optional<VarianceReduction> variance_reduction = {};
  std::optional<Draws> draws = {};
  std::optional<std::uint64_t> seed = {};
  std::optional<float> occupancy_threshold = {}, blur_radius = {}, background_depth = {};
  std::optional<DistanceMetric> distance = {};
  std::optional<OccupancyWidth> occupancy_width = {};
  std::optional<Noise> noise = {};
  std::optional<std::uint32_t> supersampling = {};

  bool operator==(const SmoothingOptions&) const = default;
};

/// The smoothing that the options describe, for images of `width` x `height`. Throws InvalidArgument where
/// they describe none. Command line, scene and views files, frames of named arrays all end here:
/// 1. The preset says everything but the seed. Without one it is `otherwise` that does. Without either it is
///    the default, "pixel", where says_nothing() or the noise is that of the pixel, and "gaussian" where
///    anything else is given: a sigma alone is one of the triangles' noise.
/// 2. What is given replaces that.
/// 3. The blur radius that is given decides alone. Else, where an occupancy_threshold is given, the radius
///    follows from it (blur_radius()). Else that of step 1 stays the same number of sigmas, as set_sigma()
///    has it: 9.21 of them in "softras", "paper_gaussian" and "paper_cauchy", none in "rigid". A variable
///    width keeps the radius of step 1 in NDC: 0.5 in "nmr"; noise of the pixel has none. The other presets
///    have no radius of their own, so that theirs follows from sigma, prior and threshold.
DPR_API Smoothing resolve_smoothing(const SmoothingOptions& given, int width = 128, int height = 128,
                                    const std::optional<Smoothing>& otherwise = {});

/// True if nothing is given but, perhaps, the seed and the supersampling.
DPR_API bool says_nothing(const SmoothingOptions& given);

/// The options of `under`, such as a file, with those of `over`, such as a command line, in their place. A
/// preset replaces all but the seed, an estimator those of both stages.
DPR_API SmoothingOptions overlay(const SmoothingOptions& under, const SmoothingOptions& over);

}  // namespace dpr
