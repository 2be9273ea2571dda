// Smoothing that follows the sign of the loss's derivative by it, eq. (17)-(18).
#include "dpr/adaptive_smoothing.hpp"

#include <algorithm>
#include <cmath>

#include "base/checks.hpp"

namespace dpr {
namespace {

constexpr std::uint32_t k_samples_limit = 1U << 20;

/// value / divisor, but never below the floor, and never up to it from below.
template <typename Number>
Number shrink(Number value, float divisor, float floor) {
  return std::max(value / static_cast<Number>(divisor), std::min(value, static_cast<Number>(floor)));
}

}  // namespace

AdaptiveSmoothing::AdaptiveSmoothing(const AdaptiveSchedule& schedule, double average)
    : schedule_(schedule), average_(average) {
  const auto positive = [](float x) { return x > 0 && std::isfinite(x); };
  require(schedule.interval > 0, "interval (adaptive smoothing)", schedule.interval, "at least 1");
  require(schedule.rate > 1 && std::isfinite(schedule.rate), "rate (adaptive smoothing)", schedule.rate,
          "a finite number above 1");
  require(positive(schedule.sigma_floor), "sigma_floor (adaptive smoothing)", schedule.sigma_floor,
          "a finite number above 0");
  require(positive(schedule.gamma_floor), "gamma_floor (adaptive smoothing)", schedule.gamma_floor,
          "a finite number above 0");
  require(schedule.max_samples >= 1 && schedule.max_samples <= k_samples_limit,
          "max_samples (adaptive smoothing)", schedule.max_samples, "1 to 2^20");
  require(schedule.learning_rate_divisor >= 1 && std::isfinite(schedule.learning_rate_divisor),
          "learning_rate_divisor (adaptive smoothing)", schedule.learning_rate_divisor,
          "a finite number, 1 or above");
  require(positive(schedule.learning_rate_floor), "learning_rate_floor (adaptive smoothing)",
          schedule.learning_rate_floor, "a finite number above 0");
  require(schedule.memory >= 0 && schedule.memory < 1, "memory (adaptive smoothing)", schedule.memory,
          "a number in [0, 1)");
}

bool AdaptiveSmoothing::update(unsigned iteration, double derivative, Smoothing& smoothing,
                               double& learning_rate) {
  require(std::isfinite(derivative), "derivative (adaptive smoothing)", derivative, "a finite number");
  const double memory = static_cast<double>(schedule_.memory);
  average_ = memory * average_ + (1 - memory) * derivative;

  const bool due = iteration >= schedule_.start && (iteration - schedule_.start) % schedule_.interval == 0;
  if (!due || average_ <= 0) return false;

  const float sigma = shrink(smoothing.sigma, schedule_.rate, schedule_.sigma_floor);
  const float gamma = shrink(smoothing.gamma, schedule_.rate, schedule_.gamma_floor);
  std::uint32_t samples = smoothing.samples;
  // The exact estimators have no use for samples: doubling them would be a change without an effect.
  const std::uint32_t most =
      schedule_.max_samples - (smoothing.draws == Draws::antithetic ? schedule_.max_samples % 2 : 0);
  if (is_sampled(smoothing) && samples < most) samples = std::min(2 * samples, most);
  if (sigma == smoothing.sigma && gamma == smoothing.gamma && samples == smoothing.samples) return false;

  set_sigma(smoothing, sigma);
  smoothing.gamma = gamma;
  smoothing.samples = samples;
  learning_rate = shrink(learning_rate, schedule_.learning_rate_divisor, schedule_.learning_rate_floor);
  return true;
}

}  // namespace dpr
