// The perturbed Heaviside by Monte Carlo with a control variate: eq. (11), (12), (14), (15) for scalar noise.
// The backward pass draws the forward pass' noise again. Where no noise can change the sign, none is drawn.
#include "noise.h"

#if DPR_LANES >= DPR_WIDTH
#include "tile_lanes.h"
#endif

/// Below the least share of samples that is not 0.
#define DPR_LEAST_SHARE 1e-7f

/// H(x + noise) in the lanes that hold a sample, 0 in the others.
static inline realn heaviside(const OccupancyParams p, float x, realn noise, uint block) {
  return choose(sample_counts(p.sampling, block) && x + noise > 0.0f, (realn)(1.0f), (realn)(0.0f));
}

static inline int never_covers(float x) { return x + highest_noise(DPR_PRIOR) <= 0.0f; }
static inline int always_covers(float x) { return x + lowest_noise(DPR_PRIOR) > 0.0f; }

/// Names a fragment's noise. `packed` is the fragment's pixel, x | y << 16.
static inline NoiseName fragment_noise(const OccupancyParams p, uint view, uint face, uint packed) {
  return name_noise(p.first_view + view, (packed >> 16) * p.width + (packed & 0xffffu), face,
                    DPR_STAGE_OCCUPANCY);
}

/// ln p of a run of fragments from their p. Apart from the samples: asked for its logarithm right away,
/// whether p is 0 would keep the processor waiting for all of them.
static inline void write_logarithms(uint first, uint last, global const float* occupancy,
                                    global float* log_occupancy) {
#if DPR_LANES < DPR_WIDTH
  for (uint i = first; i < last; ++i)
    log_occupancy[i] = occupancy[i] > 0.0f ? log(occupancy[i]) : DPR_LOG_ZERO;
#else
  for (uint i = first; i < last; i += DPR_WIDTH) {
    const realn p = load_own_run(last, i, occupancy);
    store_run(choose(p > 0.0f, log_n(max(p, DPR_LEAST_SHARE)), (realn)(DPR_LOG_ZERO)), i, last,
              log_occupancy);
  }
#endif
}

/// Any number of work-items, by pair, up to `last_pair`. Deterministic.
/// in   pair_face        uint[pair]       view * faces + face
/// in   fragment_starts  uint[pair + 1]   runs of fragments
/// in   pixels           uint[fragment]   x | y << 16
/// in out  fragments     float[plane][fragment]  OCCUPANCY, the mean, and LOG_OCCUPANCY by DISTANCE
kernel void occupancy_sampled_forward(const OccupancyParams p, const uint last_pair,
                                      global const uint* restrict pairs,
                                      global const uint* restrict pair_face,
                                      global const uint* restrict fragment_starts,
                                      global const uint* restrict pixels, global float* restrict fragments) {
  global const float* const distance = fragments + DPR_PLANE(p, DISTANCE);
  global float* const occupancy = fragments + DPR_PLANE(p, OCCUPANCY);
  const uint end = min(last_pair, pairs[0]);
  for (uint pair = (uint)get_global_id(0); pair < end; pair += (uint)get_global_size(0)) {
    const uint view = pair_face[pair] / p.faces, face = pair_face[pair] % p.faces;
    const uint first = fragment_starts[pair], last = fragment_starts[pair + 1];
    for (uint i = first; i < last; ++i) {
      const float x = distance[i] / p.sigma;
      occupancy[i] = always_covers(x) ? 1.0f : 0.0f;
      if (always_covers(x) || never_covers(x)) continue;
      const NoiseName name = fragment_noise(p, view, face, pixels[i]);
      realn sum = 0.0f;
      for (uint block = 0; DPR_WIDTH * block < p.sampling.samples; ++block) {
        sum += heaviside(p, x, draw_noise(p.sampling, DPR_PRIOR, name, block), block);
      }
      occupancy[i] = sum_lanes(sum) / (float)p.sampling.samples;
    }
    write_logarithms(first, last, occupancy, fragments + DPR_PLANE(p, LOG_OCCUPANCY));
  }
}

/// Score estimates of sigma dp/ds, with nu'(X), and of sigma dp/dsigma, with nu'(X) X - 1: d = 1 here.
static inline float2 score_estimates(const OccupancyParams p, const NoiseName name, float x) {
  const float rigid = signbit(x) ? 0.0f : p.sampling.baseline;
  float y_sum = 0.0f;
  float2 distance = 0.0f;
  ScaleSums sigma = {(realn)(0.0f), (realn)(0.0f)};
  for (uint block = 0; DPR_WIDTH * block < p.sampling.samples; ++block) {
    const realn noise = draw_noise(p.sampling, DPR_PRIOR, name, block);
    const intn counts = sample_counts(p.sampling, block);
    const realn y = choose(counts, heaviside(p, x, noise, block) - rigid, (realn)(0.0f));
    y_sum += sum_lanes(y);
    distance += add_scores(noise, noise_score(DPR_PRIOR, noise), counts, add_group(p.sampling, y), &sigma);
  }
  return (float2)(score_estimate(p.sampling, distance.x, distance.y, y_sum),
                  scale_estimate(p.sampling, sigma, y_sum));
}

/// One work-item per pair, up to `last_pair`. Deterministic. Inputs, and the occupancy, as in
/// occupancy_sampled_forward.
/// in out  grads       float[plane][fragment]  of DISTANCE by that of LOG_OCCUPANCY
/// out     grad_sigma  float[pair]             what the pair adds to dL/dsigma
kernel void occupancy_sampled_backward(const OccupancyParams p, const uint last_pair,
                                       global const uint* restrict pairs,
                                       global const uint* restrict pair_face,
                                       global const uint* restrict fragment_starts,
                                       global const uint* restrict pixels,
                                       global const float* restrict fragments, global float* restrict grads,
                                       global float* restrict grad_sigma) {
  global const float *const distance = fragments + DPR_PLANE(p, DISTANCE), *const occupancy =
                                                                               fragments +
                                                                               DPR_PLANE(p, OCCUPANCY);
  global float* const grad_distance = grads + DPR_GRAD_PLANE(p, DISTANCE);
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(last_pair, pairs[0])) return;
  const uint view = pair_face[pair] / p.faces, face = pair_face[pair] % p.faces;
  const uint first = fragment_starts[pair], last = fragment_starts[pair + 1];
  float total = 0.0f;
  for (uint i = first; i < last; ++i) {
    const float x = distance[i] / p.sigma;
    grad_distance[i] = 0.0f;
    // Samples that all agree with the rigid solution leave nothing beside the baseline.
    const int agrees =
        always_covers(x) || (!signbit(x) && occupancy[i] == 1.0f && p.sampling.baseline > 0.0f);
    if (occupancy[i] <= 0.0f || agrees) continue;
    const float2 estimates = score_estimates(p, fragment_noise(p, view, face, pixels[i]), x);
    // d ln p = dp / p
    const float chain = grads[DPR_GRAD_PLANE(p, LOG_OCCUPANCY) + i] / (occupancy[i] * p.sigma);
    grad_distance[i] = chain * estimates.x;
    total += chain * estimates.y;
  }
  grad_sigma[pair] = total;
}
