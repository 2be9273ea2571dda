// The noise's distribution, chosen at build time by DPR_PRIOR. Each prior is one file, kernels/prior_<name>.h:
//
//   prior_cdf_density(x, &cdf, &density)  F(x) and f(x), both with their relative precision into the tails
//   occupancy_log(x, &log_p, &hazard)     ln p and d ln p / dx of p = 1 - F(-x): the perturbed Heaviside (8)
//   DPR_RULE, DPR_JOINT_..., DPR_...      where aggregation's integrals are evaluated: see quadrature.h
//
// For sampling, with the prior as an argument, a constant, because the joint composition samples two of them; the
// uniform prior has no score and is not sampled:
//
//   noise_quantile(prior, u)              inverse CDF of u in (0, 1)
//   noise_score(prior, z)                 nu'(z) of the density exp(-nu)
//   lowest_noise(prior), highest_noise(prior)  bounds of what is drawn
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

/// How a prior's integrals over the line are evaluated (quadrature.h).
#define DPR_RULE_SMOOTH 0    /* light tails: equally spaced nodes around the slots */
#define DPR_RULE_TAILS 1     /* heavy tails: nodes that thin out, around every cluster of slots */
#define DPR_RULE_PIECEWISE 2 /* polynomials between kinks: Gauss-Legendre in each piece */

#include "prior_cauchy.h"
#include "prior_gaussian.h"
#include "prior_gumbel.h"
#include "prior_logistic.h"
#include "prior_uniform.h"

/// What uniform_from_bits gives lies between these.
#define DPR_LOWEST_UNIFORM 0x1p-24f
#define DPR_HIGHEST_UNIFORM (1.0f - 0x1p-24f)

/// 23 random bits, from a word of the generator, as a number in (0, 1) that is never 0 or 1: the mantissa of a number
/// in [1, 2), from which 1 less half a step is taken. Exact.
static inline realn uniform_from_bits(uintn bits) {
  return as_realn(bits >> 9 | 0x3f800000u) - (1.0f - DPR_LOWEST_UNIFORM);
}

static inline realn noise_quantile(int prior, realn u) {
  if (prior == DPR_CAUCHY) return cauchy_quantile(u);
  if (prior == DPR_LOGISTIC) return logistic_quantile(u);
  if (prior == DPR_GUMBEL) return gumbel_quantile(u);
  return gaussian_quantile(u);
}

static inline realn noise_score(int prior, realn z) {
  if (prior == DPR_CAUCHY) return cauchy_score(z);
  if (prior == DPR_LOGISTIC) return logistic_score(z);
  if (prior == DPR_GUMBEL) return gumbel_score(z);
  return gaussian_score(z);
}

static inline float lowest_noise(int prior) {
  if (prior == DPR_CAUCHY) return DPR_CAUCHY_LOWEST;
  if (prior == DPR_LOGISTIC) return DPR_LOGISTIC_LOWEST;
  if (prior == DPR_GUMBEL) return DPR_GUMBEL_LOWEST;
  return DPR_GAUSSIAN_LOWEST;
}

static inline float highest_noise(int prior) {
  if (prior == DPR_CAUCHY) return DPR_CAUCHY_HIGHEST;
  if (prior == DPR_LOGISTIC) return DPR_LOGISTIC_HIGHEST;
  if (prior == DPR_GUMBEL) return DPR_GUMBEL_HIGHEST;
  return DPR_GAUSSIAN_HIGHEST;
}

#endif
