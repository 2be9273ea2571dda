// Whether a member of the family draws samples at all.
#pragma once

#include "dpr/smoothing.hpp"

namespace dpr {

inline bool is_sampled(const Smoothing& smoothing) {
  return smoothing.occupancy_estimator == Estimator::monte_carlo ||
         smoothing.aggregation_estimator == Estimator::monte_carlo;
}

}  // namespace dpr
