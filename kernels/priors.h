// The noise's distribution, chosen at build time by DPR_PRIOR. Each prior is one file, kernels/prior_<name>.h:
//
//   prior_cdf_density(x, &cdf, &density)  F(x) and f(x), both with their relative precision into the tails
//   occupancy_log(x, &log_p, &hazard)     ln p and d ln p / dx of p = 1 - F(-x): the perturbed Heaviside (8)
//   prior_sample(u), prior_score(z)       inverse CDF of u in (0, 1); nu'(z) of the density exp(-nu), where it has one
//   DPR_RULE, DPR_JOINT_..., DPR_...      where aggregation's integrals are evaluated: see quadrature.h
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

#if DPR_PRIOR == DPR_GAUSSIAN
#include "prior_gaussian.h"
#elif DPR_PRIOR == DPR_CAUCHY
#include "prior_cauchy.h"
#elif DPR_PRIOR == DPR_LOGISTIC
#include "prior_logistic.h"
#elif DPR_PRIOR == DPR_GUMBEL
#include "prior_gumbel.h"
#elif DPR_PRIOR == DPR_UNIFORM
#include "prior_uniform.h"
#endif

/// 23 random bits, from a word of the generator, as a number in (0, 1) that is never 0 or 1.
static inline realn uniform_from_bits(uintn bits) { return mad(convert_realn(bits >> 9), 0x1p-23f, 0x1p-24f); }

#endif
