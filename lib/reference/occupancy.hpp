/// Reference for the occupancy stage: p = E[H(s + sigma X)] = 1 - F(-s/sigma).  Le Lidec et al. 2021, eq.
/// (8).
#pragma once

#include "priors.hpp"

namespace dpr::reference {

struct Occupancy {
  double p = 0.0;
  double log_p = k_minus_infinity;  ///< -infinity: the triangle is absent (uniform prior only)
};

/// `distance` is signed, positive inside; `sigma` > 0 has its unit.
inline Occupancy occupancy_forward(Prior prior, double distance, double sigma) {
  const double log_p = log_survival(prior, -distance / sigma);
  return {std::exp(log_p), log_p};
}

struct OccupancyGradient {
  double distance = 0.0;
  double sigma = 0.0;
};

/// dp/ds = mu(-s/sigma)/sigma, dp/dsigma = -(s/sigma) dp/ds; d ln p is through the hazard, which the tail
/// does not spoil. An absent triangle (p = 0) passes nothing.
inline OccupancyGradient occupancy_backward(Prior prior, double distance, double sigma, double grad_p,
                                            double grad_log_p) {
  const double x = -distance / sigma;
  if (log_survival(prior, x) == k_minus_infinity) return {};
  const double grad_distance = (grad_p * density(prior, x) + grad_log_p * hazard(prior, x)) / sigma;
  return {grad_distance, -distance / sigma * grad_distance};
}

}  // namespace dpr::reference
