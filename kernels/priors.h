// The noise's distribution, which the host names at build time: -DDPR_PRIOR=gaussian. Each prior is one file,
// kernels/prior_<name>.h. All of them define, under their names, for sampling:
//
//   <name>_quantile(u)                    inverse CDF of u in (0, 1)
//   <name>_score(z)                       nu'(z) of the density exp(-nu)
//   DPR_LOWEST_<name>, DPR_HIGHEST_<name> bounds of what is drawn
//
// but for the uniform prior, which has no score and is not sampled. The one that DPR_PRIOR names also defines
//
//   prior_cdf_density(x, &cdf, &density)  F(x) and f(x), both with their relative precision into the tails
//   occupancy_log(x, &log_p, &hazard)     ln p and d ln p / dx of p = 1 - F(-x): the perturbed Heaviside (8)
//   DPR_RULE, DPR_JOINT_..., DPR_...      where aggregation's integrals are evaluated: see quadrature.h
//
// after a test that compares words, which #if cannot: DPR_GAUSSIAN_IS_gaussian is 1, DPR_GAUSSIAN_IS_cauchy
// is not defined and so 0. Sampling takes a prior's name as an argument, because the joint composition
// samples two of them.
//
// Everything is written for vectors of lanes (lanes.h), without branches, and holds far into the tails: an
// occupancy of 1e-20 has a logarithm, and a gradient, as good as one of 0.5. Errors:
// tests/stages/priors_test.cpp.
#ifndef DPR_PRIORS_H
#define DPR_PRIORS_H

#include "lanes.h"
#include "shared_types.h"

#ifndef DPR_PRIOR
#define DPR_PRIOR gaussian
#endif

/// Rules by which a prior's integrals over the line are evaluated (quadrature.h).
#define DPR_RULE_SMOOTH 0    /* light tails: equally spaced nodes around the slots */
#define DPR_RULE_TAILS 1     /* heavy tails: nodes that thin out, around every cluster of slots */
#define DPR_RULE_PIECEWISE 2 /* polynomials between kinks: Gauss-Legendre in each piece */

#include "prior_cauchy.h"
#include "prior_gaussian.h"
#include "prior_gumbel.h"
#include "prior_logistic.h"
#include "prior_uniform.h"

/// Bounds of uniform_from_bits.
#define DPR_LOWEST_UNIFORM 0x1p-24f
#define DPR_HIGHEST_UNIFORM (1.0f - 0x1p-24f)

/// 23 random bits, from a word of the generator, as a number in (0, 1) that is never 0 or 1: the mantissa of
/// a number in [1, 2), from which 1 less half a step is taken. Exact.
static inline realn uniform_from_bits(uintn bits) {
  return as_realn(bits >> 9 | 0x3f800000u) - (1.0f - DPR_LOWEST_UNIFORM);
}

/// Functions of a prior by its name.
#define noise_quantile(prior, u) DPR_CONCAT(prior, _quantile)(u)
#define noise_score(prior, z) DPR_CONCAT(prior, _score)(z)
#define lowest_noise(prior) DPR_CONCAT(DPR_LOWEST_, prior)
#define highest_noise(prior) DPR_CONCAT(DPR_HIGHEST_, prior)

#endif
