// The perturbed Heaviside: p = E[H(s + sigma X)], exactly. Le Lidec et al. 2021, eq. (8), (21), (31), (36).
#ifdef DPR_LANES
#if DPR_LANES == 16
#define DPR_WIDTH 8 /* runs of fragments are padded to the width of the rasterizer's vectors */
#endif
#endif
#include "priors.h"

/// |s / sigma| is clamped here: far outside what any prior resolves, and its square is still a number.
#define DPR_MAX_RATIO 1e14f

static inline realn distance_ratio(realn distance, float sigma) {
  return clamp(distance / sigma, -DPR_MAX_RATIO, DPR_MAX_RATIO);
}

/// One work-item per vector of fragments. Deterministic.
/// in   distance       float[fragment]  signed, positive inside, in the unit of sigma
/// out  log_occupancy  float[fragment]  ln p, DPR_LOG_ZERO for p = 0
/// out  occupancy      float[fragment]  p, in [0, 1]
kernel void occupancy_forward(const OccupancyParams p, const uint fragments, global const float* restrict distance,
                              global float* restrict log_occupancy, global float* restrict occupancy) {
  const uint i = (uint)get_global_id(0) * DPR_WIDTH;
  if (i >= fragments) return;
  realn log_p, hazard;
  occupancy_log(distance_ratio(load_n(i, distance), p.sigma), &log_p, &hazard);
  store_n(max(log_p, DPR_LOG_ZERO), i, log_occupancy);
  store_n(exp_n(min(log_p, 0.0f)), i, occupancy);
}

/// dL/ds = dL/dln p * (d ln p / dx) / sigma, and dL/dsigma = -sum x dL/ds. One work-item per pair.
/// in   masks               uint2[pair]      says which fragments are padding: their gradients become 0
/// in   grad_log_occupancy  float[fragment]
/// out  grad_distance       float[fragment]
/// out  grad_sigma          float[pair]      what the pair adds to dL/dsigma
kernel void occupancy_backward(const OccupancyParams p, const uint pairs, global const uint2* restrict masks,
                               global const uint* restrict fragment_starts, global const float* restrict distance,
                               global const float* restrict grad_log_occupancy, global float* restrict grad_distance,
                               global float* restrict grad_sigma) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= pairs) return;
  const uint first = fragment_starts[pair];
  const uint last = first + popcount(masks[pair].x) + popcount(masks[pair].y);
  realn sum = 0.0f;
  for (uint i = first; i < last; i += DPR_WIDTH) {
    const intn real_fragment = DPR_LANE_INDEX < (intn)((int)(last - i));
    const realn x = distance_ratio(load_n(i, distance), p.sigma);
    realn log_p, hazard;
    occupancy_log(x, &log_p, &hazard);
    const realn grad = choose(real_fragment, load_n(i, grad_log_occupancy) * hazard / p.sigma, (realn)(0.0f));
    store_n(grad, i, grad_distance);
    sum -= x * grad;
  }
  grad_sigma[pair] = sum_lanes(sum);
}
