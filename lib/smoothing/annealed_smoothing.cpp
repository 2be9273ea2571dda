// Smoothing that shrinks geometrically, level by level.
#include "dpr/annealed_smoothing.hpp"

#include <algorithm>
#include <cmath>

#include "base/checks.hpp"

namespace dpr {
namespace {

/// Between start (fraction 0) and end (1), geometrically; never upwards.
double fall(double start, double end, double fraction) {
  return start * std::pow(std::min(end, start) / start, fraction);
}

}  // namespace

AnnealedSmoothing::AnnealedSmoothing(const AnnealSchedule& schedule, unsigned iterations,
                                     const Smoothing& start, double learning_rate)
    : schedule_(schedule), iterations_(iterations), start_(start), learning_rate_(learning_rate) {
  const auto positive = [](double x) { return x > 0 && std::isfinite(x); };
  require(iterations > 0, "iterations (annealing)", iterations, "at least 1");
  require(schedule.levels > 0, "levels (annealing)", schedule.levels, "at least 1");
  require(positive(schedule.sigma_end), "sigma_end (annealing)", schedule.sigma_end,
          "a finite number above 0");
  require(positive(schedule.gamma_end), "gamma_end (annealing)", schedule.gamma_end,
          "a finite number above 0");
  require(positive(schedule.learning_rate_end), "learning_rate_end (annealing)", schedule.learning_rate_end,
          "a finite number above 0");
}

bool AnnealedSmoothing::update(unsigned iteration, Smoothing& smoothing, double& learning_rate) const {
  const auto level_of = [&](unsigned i) {
    return std::min(static_cast<unsigned>(std::uint64_t{i} * schedule_.levels / iterations_),
                    schedule_.levels - 1);
  };
  const unsigned level = level_of(iteration + 1);
  if (level == level_of(iteration)) return false;

  const double fraction = static_cast<double>(level) / std::max(schedule_.levels - 1, 1U);
  set_sigma(smoothing, static_cast<float>(fall(start_.sigma, schedule_.sigma_end, fraction)));
  smoothing.gamma = static_cast<float>(fall(start_.gamma, schedule_.gamma_end, fraction));
  learning_rate = fall(learning_rate_, schedule_.learning_rate_end, fraction);
  return true;
}

}  // namespace dpr
