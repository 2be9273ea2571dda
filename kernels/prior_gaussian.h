// The normal distribution: F = Phi, nu' = z. Errors of F 2.4e-7, of ln F and f / F see priors_test.cpp.
#ifndef DPR_PRIOR_GAUSSIAN_H
#define DPR_PRIOR_GAUSSIAN_H

#include "lanes.h"

#define DPR_RULE DPR_RULE_SMOOTH
/// Barrier composition: where a slot's mass ends above it, 1 - F = 1e-7, and how much further a slot more moves that.
#define DPR_BARRIER_HIGH 5.2f
#define DPR_BARRIER_HIGH_PER_LOG 0.18f
/// The integrand is left out where the product of the F is below exp(-16).
#define DPR_BARRIER_LOG_FLOOR 16.0f
#define DPR_BARRIER_NODES 16
/// How far below the largest a slot still counts. Further down its weight is Phi(-9.5 / sqrt 2) = 1e-11 at most.
#define DPR_BARRIER_REACH 9.5f
/// Joint composition: how far a slot's density reaches below and above its beta (mass left out: 8e-7 each), and the
/// largest step between nodes where few slots cover, and where many do.
#define DPR_JOINT_BELOW 4.8f
#define DPR_JOINT_ABOVE 4.8f
#define DPR_JOINT_STEP 0.67f
#define DPR_JOINT_CROWD_STEP 0.3f

#define DPR_INVERSE_SQRT_2PI 0.398942280f
#define DPR_LOG_SQRT_2PI 0.918938533f

/// Standard normal density.
static inline realn normal_density(realn x) { return DPR_INVERSE_SQRT_2PI * exp_of_negative(-0.5f * x * x); }

/// Mills' ratio (1 - Phi(x)) / phi(x) for x >= 0: a polynomial in 1 / (1 + x / 4), fitted for the least relative error
/// on [0, 40]; 4e-7 in single precision. The ratio has no tail to lose digits in, unlike 1 - Phi.
static inline realn mills_ratio(realn x) {
  const realn t = 1.0f / fma_n(x, (realn)(0.25f), (realn)(1.0f));
  realn p = 0.0513891429f;
  p = fma_n(p, t, (realn)(-0.210481346f));
  p = fma_n(p, t, (realn)(0.253442824f));
  p = fma_n(p, t, (realn)(-0.0926696435f));
  p = fma_n(p, t, (realn)(0.166857034f));
  p = fma_n(p, t, (realn)(0.145618275f));
  p = fma_n(p, t, (realn)(0.204882696f));
  p = fma_n(p, t, (realn)(0.234275714f));
  p = fma_n(p, t, (realn)(0.249999255f));
  p = fma_n(p, t, (realn)(0.250000209f));
  return p * t;
}

static inline void prior_cdf_density(realn x, realn* cdf, realn* density) {
  *density = normal_density(x);
  const realn tail = *density * mills_ratio(fabs(x));
  *cdf = choose(x < 0.0f, tail, 1.0f - tail);
}

/// A bound from above of ln F(x), negated, and its derivative: -ln F >= 0.3 max(1.5 - x, 0)^2.
static inline float prior_log_cdf_bound(float x, float* slope) {
  const float y = max(1.5f - x, 0.0f);
  *slope = 0.6f * y;
  return 0.3f * y * y;
}

static inline void occupancy_log(realn x, realn* log_p, realn* hazard) {
  const realn mills = mills_ratio(fabs(x));
  const realn density = normal_density(x);
  const realn tail = density * mills;
  const intn negative = x < 0.0f;
  const realn log_tail = log_n(mills) - 0.5f * x * x - DPR_LOG_SQRT_2PI;
  *log_p = choose(negative, log_tail, log1p(-tail));
  *hazard = choose(negative, 1.0f / mills, density / (1.0f - tail));
}

/// Wichura's PPND7 (Algorithm AS 241, 1988): absolute error below 1e-6 for the u that 32 random bits give.
static inline realn prior_sample(realn u) {
  const realn q = u - 0.5f;
  const realn s = 0.180625f - q * q; /* 0.425^2: where the central expansion ends */
  const realn central =
      q * mad(mad(mad(59.109374720f, s, 159.29113202f), s, 50.434271938f), s, 3.3871327179f) /
      mad(mad(mad(67.187563600f, s, 78.757757664f), s, 17.895169469f), s, 1.0f);
  const realn r = sqrt(-log_n(min(u, 1.0f - u))) - 1.6f;
  const realn tail = mad(mad(mad(0.17023821103f, r, 1.3067284816f), r, 2.7568153900f), r, 1.4234372777f) /
                     mad(mad(0.12021132975f, r, 0.73700164250f), r, 1.0f);
  return choose(fabs(q) <= 0.425f, central, copysign(tail, q));
}

static inline realn prior_score(realn z) { return z; }

#endif
