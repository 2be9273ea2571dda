// The perturbed Heaviside by Monte Carlo with a control variate: eq. (11), (12), (14), (15) for scalar noise. Four
// samples at a time: the four words of one Philox call. The backward pass draws the forward pass' noise again.
#define DPR_WIDTH 4
#include "philox.h"
#include "priors.h"

/// The samples 4 * block ... 4 * block + 3 of a fragment.
static inline realn draw_noise(const OccupancyParams p, uint view, uint pixel, uint face, uint block) {
  const uint4 counter = (uint4)(pixel, face, block, (p.first_view + view) << 1 | DPR_STAGE_OCCUPANCY);
  return prior_sample(uniform_from_bits(philox4x32_10(counter, (uint2)(p.seed_low, p.seed_high))));
}

/// H(x + noise) in each lane, 0 beyond the last sample.
static inline realn heaviside(const OccupancyParams p, float x, realn noise, uint block) {
  const intn counts = (int)(4 * block) + DPR_LANE_INDEX < (intn)((int)p.samples);
  return choose(counts && x + noise > 0.0f, (realn)(1.0f), (realn)(0.0f));
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
    const uint pixel = (pixels[i] >> 16) * p.width + (pixels[i] & 0xffffu);
    const float x = distance[i] / p.sigma;
    realn sum = 0.0f;
    for (uint block = 0; 4 * block < p.samples; ++block) {
      sum += heaviside(p, x, draw_noise(p, view, pixel, face, block), block);
    }
    const float mean = sum_lanes(sum) / (float)p.samples;
    occupancy[i] = mean;
    log_occupancy[i] = mean > 0.0f ? log(mean) : DPR_LOG_ZERO;
  }
}

/// Score estimates of dp/dx = 1/M sum (H(x + X_m) - baseline H(x)) nu'(X_m) and of
/// dp/dsigma = 1/M sum (H(x + X_m) - baseline H(x)) (nu'(X_m) X_m - 1) / sigma; d = 1 here. One work-item per pair.
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
    grad_distance[i] = 0.0f;
    if (i >= last || log_occupancy[i] <= DPR_LOG_ZERO) continue;
    const uint pixel = (pixels[i] >> 16) * p.width + (pixels[i] & 0xffffu);
    const float x = distance[i] / p.sigma;
    const float rigid = x > 0.0f ? p.baseline : 0.0f;
    realn by_distance = 0.0f, by_sigma = 0.0f;
    for (uint block = 0; 4 * block < p.samples; ++block) {
      const realn noise = draw_noise(p, view, pixel, face, block);
      const intn counts = (int)(4 * block) + DPR_LANE_INDEX < (intn)((int)p.samples);
      const realn excess = choose(counts, heaviside(p, x, noise, block) - rigid, (realn)(0.0f));
      const realn score = prior_score(noise);
      by_distance += excess * score;
      by_sigma += excess * mad(score, noise, -1.0f);
    }
    // d ln p = dp / p
    const float chain = grad_log_occupancy[i] * exp(-log_occupancy[i]) / (p.sigma * (float)p.samples);
    grad_distance[i] = chain * sum_lanes(by_distance);
    total += chain * sum_lanes(by_sigma);
  }
  grad_sigma[pair] = total;
}
