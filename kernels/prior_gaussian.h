// The normal distribution: F = Phi, nu' = z. Errors of F 2.4e-7, of ln F and f / F see priors_test.cpp.
#ifndef DPR_PRIOR_GAUSSIAN_H
#define DPR_PRIOR_GAUSSIAN_H

#include "lanes.h"

/// Bounds of what is drawn: the quantiles of DPR_LOWEST_UNIFORM and DPR_HIGHEST_UNIFORM.
#define DPR_LOWEST_gaussian (-5.3f)
#define DPR_HIGHEST_gaussian 5.3f

/// Giles, "Approximating the erfinv function" (GPU Computing Gems Jade Edition, 2011): sqrt(2) erfinv(2
/// u - 1), a polynomial in w = -ln(4 u (1 - u)), and one in sqrt(w) for the 0.34% in the tails.
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

static inline realn gaussian_score(realn z) { return z; }

#define DPR_GAUSSIAN_IS_gaussian 1
#if DPR_CONCAT(DPR_GAUSSIAN_IS_, DPR_PRIOR)

#define DPR_RULE DPR_RULE_SMOOTH
/// Barrier composition: where a slot's mass ends above it, 1 - F = 1e-7, and how much further a slot more
/// moves that.
#define DPR_BARRIER_HIGH 5.2f
#define DPR_BARRIER_HIGH_PER_LOG 0.18f
/// The integrand is left out where the product of the F is below exp(-16).
#define DPR_BARRIER_LOG_FLOOR 16.0f
#define DPR_BARRIER_NODES 16
/// Slots no further below the largest than one of these count for where the integrand begins (quadrature.h).
#define DPR_BARRIER_WINDOWS ((float2)(1.2f, 3.0f))
/// Up to so many slots have closed forms (triple.h).
#define DPR_TRIPLE 3
/// Reach below the largest slot that counts. Further down its weight is Phi(-8.6 / sqrt 2) = 6e-10 at
/// most, its gradient by beta 3e-9: below the integrals' errors.
#define DPR_BARRIER_REACH 8.6f
/// Joint composition: how far a slot's density reaches below and above its beta (mass left out: 8e-7 each),
/// and the largest step between nodes where few slots cover, and where many do.
#define DPR_JOINT_BELOW 4.8f
#define DPR_JOINT_ABOVE 4.8f
#define DPR_JOINT_STEP 0.67f
#define DPR_JOINT_CROWD_STEP 0.3f

#define DPR_INVERSE_SQRT_2PI 0.398942280f
#define DPR_LOG_SQRT_2PI 0.918938533f

/// Standard normal density.
static inline realn normal_density(realn x) { return DPR_INVERSE_SQRT_2PI * exp_of_negative(-0.5f * x * x); }

/// Mills' ratio (1 - Phi(x)) / phi(x) for x >= 0: a polynomial in 1 / (1 + x / 4), fitted for the least
/// relative error on [0, 40]; 4e-7 in single precision. The ratio has no tail to lose digits in, unlike
/// 1 - Phi.
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

static inline void prior_cdf_density(realn x, realn* cdf, realn* density) {
  *density = normal_density(x);
  const realn tail = *density * mills_ratio(fabs(x));
  *cdf = choose(x < 0.0f, tail, 1.0f - tail);
}

/// Points where ln of the product of slots' F within either window is -DPR_BARRIER_LOG_FLOOR, or a little
/// lower: -ln F(x) >= 0.3 max(1.5 - x, 0)^2, and a sum of these is a parabola below the window.
static inline float2 prior_lower_ends(float2 windows, float2 count, float2 sum, float2 squares) {
  const float2 deficit = max(sum * sum - count * (squares - DPR_BARRIER_LOG_FLOOR / 0.3f), 0.0f);
  return 1.5f - max((sqrt(deficit) - sum) / count, windows);
}

static inline void occupancy_log(realn x, realn* log_p, realn* hazard) {
  const realn mills = mills_ratio(fabs(x));
  const realn density = normal_density(x);
  const realn tail = density * mills;
  const intn negative = x < 0.0f;
  const realn log_tail = log_n(mills) - 0.5f * x * x - DPR_LOG_SQRT_2PI;
  *log_p = choose(negative, log_tail, log1p_n(-tail));
  *hazard = choose(negative, 1.0f / mills, density / (1.0f - tail));
}

#endif

#endif
