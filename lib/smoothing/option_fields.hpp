// The table of the smoothing's options: every reader of them and --help walk it.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "dpr/smoothing_options.hpp"
#include "smoothing/choice_names.hpp"

namespace dpr {

/// Calls visit(key, description, member) for every member of SmoothingOptions, with a pointer to the member.
/// The key is the scene file's; with dashes it is the flag's.
template <typename Visit>
void for_each_option(Visit&& visit) {
  using O = SmoothingOptions;
  visit("preset", "Take all values from a named member of the family", &O::preset);
  visit("occupancy_prior", "Noise of the distance", &O::occupancy_prior);
  visit("depth_prior", "Noise of the depth", &O::depth_prior);
  visit("sigma", "Scale of the distance noise, in the unit of the distance", &O::sigma);
  visit("gamma", "Scale of the depth noise; depth is 1 at znear, 0 at zfar", &O::gamma);
  visit("alpha", "Weight of the barrier", &O::alpha);
  visit("composition", "Combination of occupancy and depth", &O::composition);
  visit("estimator", "Computation of both expectations", &O::estimator);
  visit("occupancy_estimator", "Overrides the estimator for the occupancy", &O::occupancy_estimator);
  visit("aggregation_estimator", "Overrides the estimator for the aggregation", &O::aggregation_estimator);
  visit("samples", "Draws of Monte Carlo", &O::samples);
  visit("variance_reduction", "Control variate of sampled gradients", &O::variance_reduction);
  visit("draws", "Way the samples' noise is drawn", &O::draws);
  visit("seed", "Seed of everything random", &O::seed);
  visit("occupancy_threshold", "Sets the blur radius where none is given", &O::occupancy_threshold);
  visit("blur_radius", "Triangles further from a pixel are not there", &O::blur_radius);
  visit("background_depth", "Normalised depth of the background", &O::background_depth);
  visit("distance", "Unit of the distance: NDC^2 or NDC", &O::distance);
  visit("occupancy_width", "Width of the distance noise: sigma, up to the pixel, or none",
        &O::occupancy_width);
  visit("noise",
        "Noise that moves edges: each triangle's distances, or the pixel's position. pixel where nothing "
        "is said of the smoothing, triangle where anything else is",
        &O::noise);
  visit("supersampling", "Rigid samples of a pixel along each axis (1, 2 or 4), of the pixel's noise",
        &O::supersampling);
}

/// The keys, in that order.
std::vector<std::string_view> option_keys();

/// An option's type in --help: "gaussian|cauchy|...", "FLOAT", "N".
template <SmoothingChoice Choice>
std::string option_type(const std::optional<Choice>&) {
  return joined(names_of_choices<Choice>());
}
std::string option_type(const std::optional<std::string>& preset);
inline std::string option_type(const std::optional<float>&) { return "FLOAT"; }
inline std::string option_type(const std::optional<std::uint32_t>&) { return "N"; }
inline std::string option_type(const std::optional<std::uint64_t>&) { return "N"; }

/// A value from a language that has numbers and words.
using OptionValue = std::variant<double, std::int64_t, std::string>;

/// Sets an option by its key; false for an unknown one. Throws InvalidArgument, which calls the option
/// `where`, for a value of the wrong kind.
bool set_option(SmoothingOptions& options, std::string_view key, const OptionValue& value,
                std::string_view where);

/// Note for options that get the default noise, that of the pixel, because neither they nor the scene name
/// one. Empty for all others.
std::string noise_note(const SmoothingOptions& scene, const SmoothingOptions& options);

}  // namespace dpr
