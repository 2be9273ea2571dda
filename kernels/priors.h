// The noise's distributions: everything the stages need of a prior, chosen at build time by DPR_PRIOR.
//
//   prior_cdf_ratio(x, &cdf, &ratio)      F(x), and f(x) / F(x), the density over it: what aggregation integrates
//   occupancy_log(x, &log_p, &hazard)     ln p and d ln p / dx of p = 1 - F(-x): the perturbed Heaviside (8)
//   prior_sample(u), prior_score(z)       inverse CDF of u in (0, 1); nu'(z) of the density exp(-nu)
//
// Everything is written for vectors of lanes (lanes.h), without branches, and holds far into the tails: an occupancy
// of 1e-20 has a logarithm, and a gradient, as good as one of 0.5. Errors: tests/stages/priors_test.cpp.
#ifndef DPR_PRIORS_H
#define DPR_PRIORS_H

#include "lanes.h"
#include "shared_types.h"

#ifndef DPR_PRIOR
#define DPR_PRIOR DPR_GAUSSIAN
#endif

#define DPR_INVERSE_SQRT_2PI 0.398942280f
#define DPR_LOG_SQRT_2PI 0.918938533f

/// Standard normal density.
static inline realn normal_density(realn x) { return DPR_INVERSE_SQRT_2PI * exp_n(-0.5f * x * x); }

/// Mills' ratio (1 - Phi(x)) / phi(x) for x >= 0: a polynomial in 1 / (1 + x / 4), fitted for the least relative error
/// on [0, 40]; 4e-7 in single precision. The ratio has no tail to lose digits in, unlike 1 - Phi.
static inline realn mills_ratio(realn x) {
  const realn t = 1.0f / mad(x, 0.25f, 1.0f);
  realn p = 0.0513891429f;
  p = mad(p, t, -0.210481346f);
  p = mad(p, t, 0.253442824f);
  p = mad(p, t, -0.0926696435f);
  p = mad(p, t, 0.166857034f);
  p = mad(p, t, 0.145618275f);
  p = mad(p, t, 0.204882696f);
  p = mad(p, t, 0.234275714f);
  p = mad(p, t, 0.249999255f);
  p = mad(p, t, 0.250000209f);
  return p * t;
}

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

#if DPR_PRIOR == DPR_GAUSSIAN

/// The smallest CDF handed out: a product of a few of them is still a number, and 1 / F finite.
#define DPR_MIN_CDF 1e-30f

static inline void prior_cdf_ratio(realn x, realn* cdf, realn* ratio) {
  const realn density = normal_density(x);
  const realn mills = mills_ratio(fabs(x));
  const realn tail = density * mills;
  const intn negative = x < 0.0f;
  const realn upper = 1.0f - tail;
  *cdf = max(choose(negative, tail, upper), DPR_MIN_CDF);
  *ratio = choose(negative, 1.0f / mills, density / upper);
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

#elif DPR_PRIOR == DPR_CAUCHY

static inline void prior_cdf_ratio(realn x, realn* cdf, realn* ratio) {
  const realn density = M_1_PI_F / mad(x, x, 1.0f);
  *cdf = cauchy_cdf(x);
  *ratio = density / *cdf;
}

static inline void occupancy_log(realn x, realn* log_p, realn* hazard) {
  realn p, ratio;
  prior_cdf_ratio(x, &p, &ratio);
  *log_p = choose(x < 0.0f, log(p), log1p(p - 1.0f));
  *hazard = ratio;
}

static inline realn prior_sample(realn u) { return -cospi(u) / sinpi(u); }

static inline realn prior_score(realn z) { return 2.0f * z / mad(z, z, 1.0f); }

#elif DPR_PRIOR == DPR_LOGISTIC

static inline void prior_cdf_ratio(realn x, realn* cdf, realn* ratio) {
  const realn e = exp_n(-fabs(x));
  const realn large = 1.0f / (1.0f + e), small = e * large;
  const intn negative = x < 0.0f;
  *cdf = choose(negative, small, large);
  *ratio = choose(negative, large, small);
}

static inline void occupancy_log(realn x, realn* log_p, realn* hazard) {
  const realn e = exp_n(-fabs(x));
  *log_p = min(x, 0.0f) - log1p(e);
  *hazard = choose(x < 0.0f, 1.0f / (1.0f + e), e / (1.0f + e));
}

static inline realn prior_sample(realn u) { return log_n(u) - log_n(1.0f - u); }

static inline realn prior_score(realn z) { return tanh(0.5f * z); }

#elif DPR_PRIOR == DPR_GUMBEL

#define DPR_MIN_CDF 1e-30f
/// exp(-exp(4.3)) is below DPR_MIN_CDF: further down nothing changes.
#define DPR_GUMBEL_FLOOR 4.3f

static inline void prior_cdf_ratio(realn x, realn* cdf, realn* ratio) {
  *ratio = exp_n(min(-x, DPR_GUMBEL_FLOOR));
  *cdf = max(exp_n(-*ratio), DPR_MIN_CDF);
}

static inline void occupancy_log(realn x, realn* log_p, realn* hazard) {
  const realn u = exp_n(min(x, DPR_GUMBEL_FLOOR));
  // For small u: ln(1 - exp(-u)) = ln u - u / 2 + u^2 / 24 - ..., without the cancellation.
  const intn small = u < 0.05f;
  const realn series = mad(u, mad(u, 1.0f / 24.0f, -0.5f), 0.0f);
  const realn survival = exp_n(-u);
  *log_p = choose(small, x + series, log1p(-survival));
  // d ln p / dx = u exp(-u) / (1 - exp(-u)) = u / (exp(u) - 1), 1 - u / 2 + u^2 / 12 for small u.
  *hazard = choose(small, mad(u, mad(u, 1.0f / 12.0f, -0.5f), 1.0f), u * survival / (1.0f - survival));
}

static inline realn prior_sample(realn u) { return -log_n(-log_n(u)); }

static inline realn prior_score(realn z) { return 1.0f - exp_n(-z); }

#elif DPR_PRIOR == DPR_UNIFORM

static inline void occupancy_log(realn x, realn* log_p, realn* hazard) {
  const realn p = clamp(x + 0.5f, 0.0f, 1.0f);
  const intn inside = (p > 0.0f) && (p < 1.0f);
  *log_p = choose(p > 0.0f, log(max(p, 1e-30f)), (realn)(DPR_LOG_ZERO));
  *hazard = choose(inside, 1.0f / max(p, 1e-30f), (realn)(0.0f));
}

#endif

/// 23 random bits, from a word of the generator, as a number in (0, 1) that is never 0 or 1.
static inline realn uniform_from_bits(uintn bits) { return mad(convert_realn(bits >> 9), 0x1p-23f, 0x1p-24f); }

#endif
