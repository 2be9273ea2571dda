// Smoothing that adapts itself to the sensitivity of the loss, eq. (17)-(18).
#pragma once

#include <cstdint>

#include "dpr/export.h"
#include "dpr/smoothing.hpp"

namespace dpr {

/// The published schedule by default, that of the paper's pose experiments.
struct AdaptiveSchedule {
  unsigned start = 100;                ///< first iteration at which the smoothing may change
  unsigned interval = 50;              ///< iterations between two checks
  float rate = 1.1F;                   ///< > 1: sigma and gamma are divided by it
  float sigma_floor = 5e-5F;           ///< > 0
  float gamma_floor = 5e-4F;           ///< > 0
  std::uint32_t max_samples = 128;     ///< samples double up to this; antithetic draws stay even
  float learning_rate_divisor = 1.5F;  ///< >= 1, applied with each change
  float learning_rate_floor = 1e-4F;
  float memory = 0.9F;  ///< v <- memory v + (1 - memory) derivative
};

/// Watches the loss's derivative by the smoothing, and shrinks sigma and gamma while less means less loss:
/// d loss / d gamma, as published; with noise on the pixel d loss / d sigma, since gamma says nothing where
/// surfaces do not overlap. Works with any member of the family. A blur radius given explicitly shrinks with
/// sigma.
class DPR_API AdaptiveSmoothing {
 public:
  /// `average` is that of the run it goes on from. Throws InvalidArgument for a schedule out of range.
  explicit AdaptiveSmoothing(const AdaptiveSchedule& schedule = {}, double average = 0);

  /// To be called once an iteration. Returns true if it changed `smoothing`; then the optimizer should be
  /// restarted with `learning_rate`, which it divides too. Until the first check only the average is formed.
  bool update(unsigned iteration, double derivative, Smoothing& smoothing, double& learning_rate);

  double average() const { return average_; }

 private:
  AdaptiveSchedule schedule_;
  double average_;
};

}  // namespace dpr
