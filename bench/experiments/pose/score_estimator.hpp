// Values and derivatives of E[f(theta + scale Z)] from samples of f alone: the score estimator with control
// variates, Le Lidec et al. 2021, eq. (11)-(16), for noise of any dimension.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "dpr/smoothing.hpp"

namespace dpr::bench {

/// Philox4x32-10 (Salmon et al. 2011) on the host: random words as a pure function of counter and key.
std::array<std::uint32_t, 4> philox4x32_10(std::array<std::uint32_t, 4> counter,
                                           std::array<std::uint32_t, 2> key);

struct NoiseOptions {
  Prior prior = Prior::gaussian;
  VarianceReduction variance_reduction = VarianceReduction::leave_one_out;
  Draws draws = Draws::antithetic;
  std::uint32_t samples = 64;
  std::uint64_t seed = 1;
};

/// Throws InvalidArgument for what has no unbiased estimator, see PerturbedPose.
void validate(const NoiseOptions& options);

/// Z, [sample][dimension].
std::vector<double> draw_noise(const NoiseOptions& options, std::size_t dimensions);

struct Estimate {
  double value = 0, error = 0;  ///< error: the standard error, 0 where one independent draw cannot tell
};

struct ScoreEstimate {
  Estimate value;
  std::vector<Estimate> gradient;  ///< [dimension], for theta / scale: to be divided by the scale
  Estimate sensitivity;            ///< for a common factor of the scales
};

/// @param values  f of every sample
/// @param noise   the draw_noise() of the same options
/// @param rigid   f without noise; read for the baseline of that name only
ScoreEstimate estimate(const NoiseOptions& options, std::span<const double> values,
                       std::span<const double> noise, double rigid);

}  // namespace dpr::bench
