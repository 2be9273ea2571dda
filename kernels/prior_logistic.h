// The logistic distribution: F = 1 / (1 + exp(-x)) (21), nu' = tanh(z / 2).
#ifndef DPR_PRIOR_LOGISTIC_H
#define DPR_PRIOR_LOGISTIC_H

#include "lanes.h"

/// Bounds of what is drawn: the quantiles of DPR_LOWEST_UNIFORM and DPR_HIGHEST_UNIFORM.
#define DPR_LOWEST_logistic (-16.7f)
#define DPR_HIGHEST_logistic 16.7f

static inline realn logistic_quantile(realn u) { return log_n(u) - log_n(1.0f - u); }

/// tanh(z / 2).
static inline realn logistic_score(realn z) {
  const realn e = exp_n(-fabs(z));
  return copysign((1.0f - e) / (1.0f + e), z);
}

#define DPR_LOGISTIC_IS_logistic 1
#if DPR_CONCAT(DPR_LOGISTIC_IS_, DPR_PRIOR)

#define DPR_RULE DPR_RULE_SMOOTH
/// As in prior_gaussian.h; 1 - F = 5e-7 at the upper end.
#define DPR_BARRIER_HIGH 14.5f
#define DPR_BARRIER_HIGH_PER_LOG 1.0f
#define DPR_BARRIER_LOG_FLOOR 16.0f
#define DPR_BARRIER_NODES 32
#define DPR_BARRIER_WINDOWS ((float2)(2.0f, 6.0f))
#define DPR_BARRIER_REACH 26.0f
#define DPR_JOINT_BELOW 14.0f
#define DPR_JOINT_ABOVE 14.0f
#define DPR_JOINT_STEP 0.95f
#define DPR_JOINT_CROWD_STEP 0.475f

static inline void prior_cdf_density(realn x, realn* cdf, realn* density) {
  const realn e = exp_of_negative(-fabs(x));
  const realn large = 1.0f / (1.0f + e), small = e * large;
  *cdf = choose(x < 0.0f, small, large);
  *density = small * large;
}

/// As in prior_gaussian.h, by -ln F(x) >= max(-x, 0).
static inline float2 prior_lower_ends(float2 windows, float2 count, float2 sum, float2 squares) {
  (void)squares;
  return min((sum - DPR_BARRIER_LOG_FLOOR) / count, -windows);
}

static inline void occupancy_log(realn x, realn* log_p, realn* hazard) {
  const realn e = exp_n(-fabs(x));
  *log_p = min(x, 0.0f) - log1p_n(e);
  *hazard = choose(x < 0.0f, 1.0f / (1.0f + e), e / (1.0f + e));
}

#endif

#endif
