// Options of the methods that find poses.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "cli/option_names.hpp"
#include "dpr/pose.hpp"

namespace dpr::cli {

/// Least squares as the command line describes them.
struct LeastSquaresOptions {
  LeastSquares method;
  std::string light = "harmonics", mask{};  ///< the mask is a file
};

void add_least_squares_options(CLI::App& command, const char* group, LeastSquaresOptions& options);
/// Their fields that have another name there.
inline const OptionNames k_least_squares_names{{"iterations", "--level-iterations"},
                                               {"robust_scale", "--robust"}};

/// --silhouette-weight, --depth-scale and --depth-weight.
void add_observation_weights(CLI::App& command, const char* group, LeastSquares& method,
                             std::optional<float>& depth_scale);

/// The method that the options describe, without the mask. Throws InvalidArgument.
LeastSquares read_least_squares(const CLI::App& command, const LeastSquaresOptions& options);

/// A descent as the command line describes it.
struct DescentOptions {
  Descent method;
  std::string loss = "mse", optimizer = "adam", schedule = "anneal";
};

void add_descent_options(CLI::App& command, const char* group, DescentOptions& options);
/// Throws InvalidArgument.
Descent read_descent(const CLI::App& command, const DescentOptions& options);

}  // namespace dpr::cli
