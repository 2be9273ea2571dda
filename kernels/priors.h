// The noise's distributions: everything the stages need of a prior, chosen at build time by DPR_PRIOR.
//
//   prior_cdf_ratio(x, &cdf, &ratio)      F(x), and f(x) / F(x), the density over it: what aggregation integrates
//   occupancy_log(x, &log_p, &hazard)     ln p and d ln p / dx of p = 1 - F(-x): the perturbed Heaviside (8)
//   noise_quantile(prior, u)              inverse CDF of u in (0, 1)
//   noise_score(prior, z)                 nu'(z) of the density exp(-nu)
//   lowest_noise(prior), highest_noise(prior)  bounds of what is drawn
//
// The last three take the prior as an argument, a constant: the joint composition samples two of them.
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

#elif DPR_PRIOR == DPR_UNIFORM

static inline void occupancy_log(realn x, realn* log_p, realn* hazard) {
  const realn p = clamp(x + 0.5f, 0.0f, 1.0f);
  const intn inside = (p > 0.0f) && (p < 1.0f);
  *log_p = choose(p > 0.0f, log(max(p, 1e-30f)), (realn)(DPR_LOG_ZERO));
  *hazard = choose(inside, 1.0f / max(p, 1e-30f), (realn)(0.0f));
}

#endif

// Sampling. The uniform prior has no score and is not sampled.

/// What uniform_from_bits gives lies between these.
#define DPR_LOWEST_UNIFORM 0x1p-24f
#define DPR_HIGHEST_UNIFORM (1.0f - 0x1p-24f)

/// Giles, "Approximating the erfinv function" (GPU Computing Gems Jade Edition, 2011): sqrt(2) erfinv(2 u - 1), a
/// polynomial in w = -ln(4 u (1 - u)), and one in sqrt(w) for the 0.34% in the tails.
static inline realn gaussian_quantile(realn u) {
  const realn w = -log_n(4.0f * u * (1.0f - u));
  const realn c = w - 2.5f;
  realn p = 2.81022636e-08f;
  p = mad(p, c, 3.43273939e-07f);
  p = mad(p, c, -3.5233877e-06f);
  p = mad(p, c, -4.39150654e-06f);
  p = mad(p, c, 0.00021858087f);
  p = mad(p, c, -0.00125372503f);
  p = mad(p, c, -0.00417768164f);
  p = mad(p, c, 0.246640727f);
  p = mad(p, c, 1.50140941f);
  const intn is_tail = w >= 5.0f; /* where the first polynomial ends */
  if (any_lane(is_tail)) {
    const realn r = sqrt(max(w, 5.0f)) - 3.0f;
    realn q = -0.000200214257f;
    q = mad(q, r, 0.000100950558f);
    q = mad(q, r, 0.00134934322f);
    q = mad(q, r, -0.00367342844f);
    q = mad(q, r, 0.00573950773f);
    q = mad(q, r, -0.0076224613f);
    q = mad(q, r, 0.00943887047f);
    q = mad(q, r, 1.00167406f);
    q = mad(q, r, 2.83297682f);
    p = choose(is_tail, q, p);
  }
  return M_SQRT2_F * p * mad(2.0f, u, -1.0f);
}

/// -cot(pi u), by way of the Taylor polynomials of sine and cosine on [0, pi / 4]: relative error 5e-8 before rounding.
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

static inline realn noise_quantile(int prior, realn u) {
  if (prior == DPR_CAUCHY) return cauchy_quantile(u);
  if (prior == DPR_LOGISTIC) return log_n(u) - log_n(1.0f - u);
  if (prior == DPR_GUMBEL) return -log_n(-log_n(u));
  return gaussian_quantile(u);
}

static inline realn noise_score(int prior, realn z) {
  if (prior == DPR_CAUCHY) return 2.0f * z / mad(z, z, 1.0f);
  if (prior == DPR_GUMBEL) return 1.0f - exp_n(-z);
  if (prior == DPR_LOGISTIC) {
    const realn e = exp_n(-fabs(z));
    return copysign((1.0f - e) / (1.0f + e), z);
  }
  return z;
}

/// No noise is above this, the quantile of DPR_HIGHEST_UNIFORM.
static inline float highest_noise(int prior) {
  if (prior == DPR_CAUCHY) return 5.35e6f;
  return prior == DPR_GAUSSIAN ? 5.3f : 16.7f;
}

/// No noise is below this.
static inline float lowest_noise(int prior) { return prior == DPR_GUMBEL ? -2.82f : -highest_noise(prior); }

/// 23 random bits, from a word of the generator, as a number in (0, 1) that is never 0 or 1: the mantissa of a number
/// in [1, 2), from which 1 less half a step is taken. Exact.
static inline realn uniform_from_bits(uintn bits) {
  return as_realn(bits >> 9 | 0x3f800000u) - (1.0f - DPR_LOWEST_UNIFORM);
}

#endif
