// The Gumbel distribution of maxima: F = exp(-exp(-x)), nu' = 1 - exp(-z). Its perturbed arg-max is the
// softmax (40).
#ifndef DPR_PRIOR_GUMBEL_H
#define DPR_PRIOR_GUMBEL_H

#include "lanes.h"

/// Bounds of what is drawn: the quantiles of DPR_LOWEST_UNIFORM and DPR_HIGHEST_UNIFORM.
#define DPR_LOWEST_gumbel (-2.82f)
#define DPR_HIGHEST_gumbel 16.7f

static inline realn gumbel_quantile(realn u) { return -log_n(-log_n(u)); }

static inline realn gumbel_score(realn z) { return 1.0f - exp_n(-z); }

#define DPR_GUMBEL_IS_gumbel 1
#if DPR_CONCAT(DPR_GUMBEL_IS_, DPR_PRIOR)

#define DPR_RULE DPR_RULE_SMOOTH
#define DPR_SOFTMAX 1
#define DPR_BARRIER_REACH 20.0f /* exp(-20) = 2e-9 */
/// As in prior_gaussian.h.
#define DPR_JOINT_BELOW 3.0f
#define DPR_JOINT_ABOVE 14.0f
#define DPR_JOINT_STEP 0.53f
#define DPR_JOINT_CROWD_STEP 0.265f

/// exp(-exp(4.3)) is 1e-32: further down nothing changes.
#define DPR_GUMBEL_FLOOR 4.3f

static inline void prior_cdf_density(realn x, realn* cdf, realn* density) {
  const realn u = exp_n(min(-x, DPR_GUMBEL_FLOOR));
  *cdf = exp_n(-u);
  *density = u * *cdf;
}

static inline void occupancy_log(realn x, realn* log_p, realn* hazard) {
  const realn u = exp_n(min(x, DPR_GUMBEL_FLOOR));
  // The series ln(1 - exp(-u)) = ln u - u / 2 + u^2 / 24 - ... avoids the cancellation for small u.
  const intn small = u < 0.05f;
  const realn series = mad(u, mad(u, 1.0f / 24.0f, -0.5f), 0.0f);
  const realn survival = exp_n(-u);
  *log_p = choose(small, x + series, log1p_n(-survival));
  // d ln p / dx = u exp(-u) / (1 - exp(-u)) = u / (exp(u) - 1), 1 - u / 2 + u^2 / 12 for small u.
  *hazard = choose(small, mad(u, mad(u, 1.0f / 12.0f, -0.5f), 1.0f), u * survival / (1.0f - survival));
}

#endif

#endif
