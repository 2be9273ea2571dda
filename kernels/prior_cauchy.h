// The Cauchy distribution: F = 1/2 + atan(x) / pi (35), nu' = 2 z / (1 + z^2).
#ifndef DPR_PRIOR_CAUCHY_H
#define DPR_PRIOR_CAUCHY_H

#include "lanes.h"

/// Bounds of what is drawn: the quantiles of DPR_LOWEST_UNIFORM and DPR_HIGHEST_UNIFORM.
#define DPR_LOWEST_cauchy (-5.35e6f)
#define DPR_HIGHEST_cauchy 5.35e6f

/// -cot(pi u), by way of the Taylor polynomials of sine and cosine on [0, pi / 4]: relative error 5e-8 before
/// rounding.
static inline realn cauchy_quantile(realn u) {
  const realn folded = min(u, 1.0f - u); /* cot(pi u) = -cot(pi (1 - u)) */
  const intn is_outer = folded <= 0.25f;
  const realn x = M_PI_F * choose(is_outer, folded, 0.5f - folded);
  const realn s = x * x;
  realn sine = 2.75573192e-6f;
  sine = mad(sine, s, -1.98412698e-4f);
  sine = mad(sine, s, 8.33333333e-3f);
  sine = mad(sine, s, -1.66666667e-1f);
  sine = mad(sine, s, 1.0f) * x;
  realn cosine = 2.48015873e-5f;
  cosine = mad(cosine, s, -1.38888889e-3f);
  cosine = mad(cosine, s, 4.16666667e-2f);
  cosine = mad(cosine, s, -0.5f);
  cosine = mad(cosine, s, 1.0f);
  const realn size = choose(is_outer, cosine, sine) / choose(is_outer, sine, cosine);
  return choose(u < 0.5f, -size, size);
}

static inline realn cauchy_score(realn z) { return 2.0f * z / mad(z, z, 1.0f); }

#define DPR_CAUCHY_IS_cauchy 1
#if DPR_CONCAT(DPR_CAUCHY_IS_, DPR_PRIOR)

#define DPR_RULE DPR_RULE_TAILS
#define DPR_BARRIER_REACH INFINITY
/// Slots within this distance of a cluster's head share its nodes.
#define DPR_HEAD_WIDTH 1.0f
/// Distance of the outermost nodes: the mass beyond is 1 / (pi 1e6) a slot.
#define DPR_TAIL_REACH 1e6f
/// Joint composition: slots further apart than the sum are taken one after the other, wrong by 1 / (pi 1e6).
#define DPR_JOINT_BELOW 5e5f
#define DPR_JOINT_ABOVE 5e5f

/// atan(z) / pi for 0 <= z <= 1: odd polynomial fitted for the least relative error, 2e-8 before rounding.
static inline realn atan_over_pi(realn z) {
  const realn s = z * z;
  realn p = 0.00284993788f;
  p = mad(p, s, -0.0160688814f);
  p = mad(p, s, 0.0426920466f);
  p = mad(p, s, -0.0750435144f);
  p = mad(p, s, 0.106409691f);
  p = mad(p, s, -0.142036572f);
  p = mad(p, s, 0.199926212f);
  p = mad(p, s, -0.333330721f);
  p = mad(p, s, 1.0f);
  return M_1_PI_F * z * p;
}

/// Cauchy's CDF, eq. (35). Below -1 by way of 1 / x, so that the tail keeps its relative precision.
static inline realn cauchy_cdf(realn x) {
  const realn a = fabs(x);
  const intn outer = a > 1.0f;
  const realn tail = atan_over_pi(choose(outer, 1.0f / max(a, 1e-30f), a));
  const realn lower = choose(outer, tail, 0.5f - tail);
  return choose(x < 0.0f, lower, 1.0f - lower);
}

static inline void prior_cdf_density(realn x, realn* cdf, realn* density) {
  *density = M_1_PI_F / mad(x, x, 1.0f);
  *cdf = cauchy_cdf(x);
}

static inline void occupancy_log(realn x, realn* log_p, realn* hazard) {
  realn p, density;
  prior_cdf_density(x, &p, &density);
  *log_p = choose(x < 0.0f, log(p), log1p(p - 1.0f));
  *hazard = density / p;
}

#endif

#endif
