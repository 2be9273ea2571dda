// Options that a pose from one image and poses of a sequence share.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "dpr/pose.hpp"

namespace dpr::cli {

/// Least squares as the command line describes them.
struct LeastSquaresOptions {
  LeastSquares method;
  std::string light = "harmonics", mask{};  ///< the mask is a file
};

void add_least_squares_options(CLI::App& command, const char* group, LeastSquaresOptions& options);

/// The method that the options describe, without the mask. Throws InvalidArgument.
LeastSquares read_least_squares(const CLI::App& command, const LeastSquaresOptions& options);

}  // namespace dpr::cli
