// The perturbed Heaviside: p = E[H(s + sigma X)], exactly. Le Lidec et al. 2021, eq. (8), (21), (31), (36).
#include "tile_lanes.h"

#include "priors.h"

/// Occupancy of a fragment: p, ln p, d ln p / ds, and x with d / dsigma = -x d / ds.
typedef struct {
  realn p, log_p, slope, ratio;
} Perturbed;

/// H(s), by the sign bit: at distance 0 the sign says who owns the sample.
static inline intn is_positive(realn distance) { return as_intn(distance) >= 0; }

/// Least distance of occupancies from 0 and 1, where the chain through ln p and the colour behind an opaque
/// triangle would be lost.
#define DPR_RIGID_MARGIN 1e-6f

/// The rigid image's occupancy, with the slope of uniform noise whose width is the distance from the pixel to
/// the edge, |s|: over that distance p changes by 1 (Kato, Ushiku & Harada, "Neural 3D Mesh Renderer", CVPR
/// 2018, section 3.2). Sigma keeps the slope finite at the edge; the image does not depend on it.
static inline Perturbed perturb_by_distance(realn distance, float sigma) {
  const intn inside = is_positive(distance);
  Perturbed v;
  v.p = choose(inside, (realn)(1.0f - DPR_RIGID_MARGIN), (realn)(DPR_RIGID_MARGIN));
  v.log_p = choose(inside, (realn)(log1p(-DPR_RIGID_MARGIN)), (realn)(log(DPR_RIGID_MARGIN)));
  v.slope = 1.0f / ((fabs(distance) + sigma) * v.p);
  v.ratio = 0.0f;
  return v;
}

/// The rigid image's occupancy (1): no noise, no slope.
static inline Perturbed unperturbed(realn distance) {
  const intn inside = is_positive(distance);
  Perturbed v;
  v.p = choose(inside, (realn)(1.0f), (realn)(0.0f));
  v.log_p = choose(inside, (realn)(0.0f), (realn)(DPR_LOG_ZERO));
  v.slope = 0.0f;
  v.ratio = 0.0f;
  return v;
}

/// |s / sigma| is clamped here: far outside what any prior resolves, and its square is still a number.
#define DPR_MAX_RATIO 1e14f

static inline Perturbed perturb(realn distance, const OccupancyParams p) {
  if (p.noise_width == DPR_ZERO_WIDTH) return unperturbed(distance);
  if (p.noise_width == DPR_VARIABLE_WIDTH) return perturb_by_distance(distance, p.sigma);
  Perturbed v;
  realn hazard;
  v.ratio = clamp(distance / p.sigma, -DPR_MAX_RATIO, DPR_MAX_RATIO);
  occupancy_log(v.ratio, &v.log_p, &hazard);
  v.p = exp_n(lesser(v.log_p, 0.0f));
  v.slope = hazard / p.sigma;
  return v;
}

/// Any number of work-items, by vector of fragments. Deterministic.
/// in   fragment_starts  uint[pair + 1]   up to `last_pair`: its last is the number of fragments
/// in out  fragments     float[plane][fragment]  LOG_OCCUPANCY and OCCUPANCY by DISTANCE
kernel void occupancy_forward(const OccupancyParams p, const uint last_pair,
                              global const uint* restrict fragment_starts, global float* restrict fragments) {
  const uint last = fragment_starts[last_pair], step = (uint)get_global_size(0) * DPR_WIDTH;
  for (uint i = (uint)get_global_id(0) * DPR_WIDTH; i < last; i += step) {
    const Perturbed v = perturb(load_n(i, fragments + DPR_PLANE(p, DISTANCE)), p);
    store_n(greater(v.log_p, DPR_LOG_ZERO), i, fragments + DPR_PLANE(p, LOG_OCCUPANCY));
    store_n(v.p, i, fragments + DPR_PLANE(p, OCCUPANCY));
  }
}

/// dL/ds = dL/dln p * d ln p / ds, and dL/dsigma, which with x = s / sigma is -sum x dL/ds. One work-item per
/// group of pairs in `range`.
/// in   fragment_starts, fragments  as occupancy_forward
/// in out  grads       float[plane][fragment]  of DISTANCE by that of LOG_OCCUPANCY
/// out     grad_sigma  float[pair]             what the pair adds to dL/dsigma
kernel void occupancy_backward(const OccupancyParams p, const uint2 range, global const uint* restrict pairs,
                               global const uint* restrict fragment_starts,
                               global const float* restrict fragments, global float* restrict grads,
                               global float* restrict grad_sigma) {
  const uint2 group = pair_group(range, pairs[0]);
  if (group.x >= group.y) return;
  const uint end = fragment_starts[group.y];
  for (uint pair = group.x; pair < group.y; ++pair) {
    const uint last = fragment_starts[pair + 1];
    realn sum = 0.0f;
    for (uint i = fragment_starts[pair]; i < last; i += DPR_WIDTH) {
      const intn in_run = lanes_before(last, i);
      const Perturbed v = perturb(load_run(in_run, i, fragments + DPR_PLANE(p, DISTANCE)), p);
      const realn grad = load_run(in_run, i, grads + DPR_GRAD_PLANE(p, LOG_OCCUPANCY)) * v.slope;
      store_run(grad, i, end, grads + DPR_GRAD_PLANE(p, DISTANCE));
      sum -= v.ratio * grad;
    }
    grad_sigma[pair] = sum_lanes(sum);
  }
}

/// Tangents of ln p by those of distances and of sigma. Any number of work-items, by vector of fragments.
/// Deterministic.
/// in   fragment_starts, fragments  as occupancy_forward
/// in   frames       FrameTangent[direction]
/// in out  tangents  float[direction][q.planes][fragment]  LOG_OCCUPANCY, where those of distances are
kernel void occupancy_tangent(const OccupancyParams p, const uint last_pair, const TangentParams q,
                              global const uint* restrict fragment_starts,
                              global const float* restrict fragments,
                              global const FrameTangent* restrict frames, global float* restrict tangents) {
  const uint last = fragment_starts[last_pair], step = (uint)get_global_size(0) * DPR_WIDTH;
  for (uint i = (uint)get_global_id(0) * DPR_WIDTH; i < last; i += step) {
    const Perturbed v = perturb(load_n(i, fragments + DPR_PLANE(p, DISTANCE)), p);
    for (uint d = 0; d < q.directions; ++d) {
      global float* const out =
          tangents + (size_t)d * q.planes * p.grad_fragments + DPR_GRAD_PLANE(p, LOG_OCCUPANCY);
      store_n(v.slope * (load_n(i, out) - v.ratio * frames[d].sigma), i, out);
    }
  }
}
