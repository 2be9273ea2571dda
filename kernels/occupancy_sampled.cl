// The perturbed Heaviside by Monte Carlo with a control variate: eq. (11), (12), (14), (15) for scalar noise. The
// backward pass draws the forward pass' noise again. Where no noise can change the sign, none is drawn.
#include "noise.h"

/// H(x + noise) in the lanes that hold a sample, 0 in the others.
static inline realn heaviside(const OccupancyParams p, float x, realn noise, uint block) {
  return choose(sample_counts(p.sampling, block) && x + noise > 0.0f, (realn)(1.0f), (realn)(0.0f));
}

static inline int never_covers(float x) { return x + highest_noise(DPR_PRIOR) <= 0.0f; }
static inline int always_covers(float x) { return x + lowest_noise(DPR_PRIOR) > 0.0f; }

/// Names a fragment's noise. `packed` is the fragment's pixel, x | y << 16.
static inline NoiseName fragment_noise(const OccupancyParams p, uint view, uint face, uint packed) {
  return name_noise(view, (packed >> 16) * p.width + (packed & 0xffffu), face, DPR_STAGE_OCCUPANCY);
}

/// One work-item per pair.
/// in   pair_face      uint[pair]
/// in   pixels         uint[fragment]   x | y << 16
/// in   distance       float[fragment]
/// out  log_occupancy  float[fragment]  ln of the mean, DPR_LOG_ZERO where no sample covers
/// out  occupancy      float[fragment]  the mean
kernel void occupancy_sampled_forward(const OccupancyParams p, const uint pairs, global const uint* restrict pair_face,
                                      global const uint* restrict fragment_starts, global const uint* restrict pixels,
                                      global const float* restrict distance, global float* restrict log_occupancy,
                                      global float* restrict occupancy) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= pairs) return;
  const uint view = pair_face[pair] / p.faces, face = pair_face[pair] % p.faces;
  for (uint i = fragment_starts[pair]; i < fragment_starts[pair + 1]; ++i) {
    const float x = distance[i] / p.sigma;
    float mean = always_covers(x) ? 1.0f : 0.0f;
    if (!always_covers(x) && !never_covers(x)) {
      const NoiseName name = fragment_noise(p, view, face, pixels[i]);
      realn sum = 0.0f;
      for (uint block = 0; DPR_WIDTH * block < p.sampling.samples; ++block) {
        sum += heaviside(p, x, draw_noise(p.sampling, DPR_PRIOR, name, block), block);
      }
      mean = sum_lanes(sum) / (float)p.sampling.samples;
    }
    occupancy[i] = mean;
    log_occupancy[i] = mean > 0.0f ? log(mean) : DPR_LOG_ZERO;
  }
}

/// Score estimates of sigma dp/ds, with nu'(X), and of sigma dp/dsigma, with nu'(X) X - 1: d = 1 here.
static inline float2 score_estimates(const OccupancyParams p, const NoiseName name, float x) {
  const float rigid = x > 0.0f ? p.sampling.baseline : 0.0f;
  realn y_sum = 0.0f, distance = 0.0f, distance_scores = 0.0f, sigma = 0.0f, sigma_scores = 0.0f;
  for (uint block = 0; DPR_WIDTH * block < p.sampling.samples; ++block) {
    const realn noise = draw_noise(p.sampling, DPR_PRIOR, name, block);
    const intn counts = sample_counts(p.sampling, block);
    const realn y = choose(counts, heaviside(p, x, noise, block) - rigid, (realn)(0.0f));
    const realn grouped = add_group(p.sampling, y);
    const realn score = choose(counts, noise_score(DPR_PRIOR, noise), (realn)(0.0f));
    const realn scale_score = choose(counts, mad(score, noise, -1.0f), (realn)(0.0f));
    y_sum += y;
    distance += grouped * score;
    distance_scores += score;
    sigma += grouped * scale_score;
    sigma_scores += scale_score;
  }
  const float sum = sum_lanes(y_sum);
  return (float2)(score_estimate(p.sampling, sum_lanes(distance), sum_lanes(distance_scores), sum),
                  score_estimate(p.sampling, sum_lanes(sigma), sum_lanes(sigma_scores), sum));
}

/// One work-item per pair.
/// in   masks               uint2[pair]  says which fragments are padding: their gradients become 0
/// in   grad_log_occupancy  float[fragment]
/// out  grad_distance       float[fragment]
/// out  grad_sigma          float[pair]
kernel void occupancy_sampled_backward(const OccupancyParams p, const uint pairs,
                                       global const uint* restrict pair_face, global const uint2* restrict masks,
                                       global const uint* restrict fragment_starts,
                                       global const uint* restrict pixels, global const float* restrict distance,
                                       global const float* restrict log_occupancy,
                                       global const float* restrict grad_log_occupancy,
                                       global float* restrict grad_distance, global float* restrict grad_sigma) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= pairs) return;
  const uint view = pair_face[pair] / p.faces, face = pair_face[pair] % p.faces;
  const uint first = fragment_starts[pair];
  const uint last = first + popcount(masks[pair].x) + popcount(masks[pair].y);
  float total = 0.0f;
  for (uint i = first; i < fragment_starts[pair + 1]; ++i) {
    const float x = distance[i] / p.sigma;
    grad_distance[i] = 0.0f;
    if (i >= last || log_occupancy[i] <= DPR_LOG_ZERO || always_covers(x)) continue;
    const float2 estimates = score_estimates(p, fragment_noise(p, view, face, pixels[i]), x);
    // d ln p = dp / p
    const float chain = grad_log_occupancy[i] * exp(-log_occupancy[i]) / p.sigma;
    grad_distance[i] = chain * estimates.x;
    total += chain * estimates.y;
  }
  grad_sigma[pair] = total;
}
