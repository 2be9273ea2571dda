// The uniform distribution on (-1/2, 1/2): F = clamp(x + 1/2, 0, 1) (30). It has no score.
#ifndef DPR_PRIOR_UNIFORM_H
#define DPR_PRIOR_UNIFORM_H

#include "lanes.h"

#define DPR_UNIFORM_IS_uniform 1
#if DPR_CONCAT(DPR_UNIFORM_IS_, DPR_PRIOR)

#define DPR_RULE DPR_RULE_PIECEWISE
/// End of the density.
#define DPR_HALF_WIDTH 0.5f
#define DPR_BARRIER_REACH 1.0f
#define DPR_JOINT_BELOW 0.5f
#define DPR_JOINT_ABOVE 0.5f
/// Up to this many slots the 16-node rule is exact: it integrates polynomials of degree 31.
#define DPR_PIECE_SLOTS 32

static inline void prior_cdf_density(realn x, realn* cdf, realn* density) {
  *cdf = clamp(x + 0.5f, 0.0f, 1.0f);
  *density = choose(fabs(x) < 0.5f, (realn)(1.0f), (realn)(0.0f));
}

static inline void occupancy_log(realn x, realn* log_p, realn* hazard) {
  const realn p = clamp(x + 0.5f, 0.0f, 1.0f);
  const intn inside = (p > 0.0f) && (p < 1.0f);
  *log_p = choose(p > 0.0f, log(max(p, 1e-30f)), (realn)(DPR_LOG_ZERO));
  *hazard = choose(inside, 1.0f / max(p, 1e-30f), (realn)(0.0f));
}

#endif

#endif
