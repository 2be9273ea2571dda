// The perturbed arg-max by Monte Carlo with a control variate, for the barrier composition: eq. (9)-(16).
// Each sample perturbs every slot's beta, the largest wins, the pixel takes its colour. A fragment with p = 0
// is no slot.
//
//   dL/dbeta_k       = 1/M sum_m (y_m - b_m) nu'(Z_km)                                          (12), (14)
//   dL/dgamma at b   = 1/M sum_m (y_m - b_m) sum_k (nu'(Z_km) Z_km - 1) / gamma                 (15), (16)
//
// with y = <dL/dcolour, colour of the winner>, the baselines b of noise.h, and the sums over the slots that
// could have won in the sample's block, given the noise of the others: y does not depend on the rest. The sum
// over all d of them has the constant d: the change of variables has the determinant gamma^-d.
#include "sampled_pixel.h"

/// State shared by a pixel's slots. A slot is a place in the pixel's run, or -1 for the background.
typedef struct {
  SampledRun run;
  BarrierPixel barrier;
} Pixel;

/// DPR_LOG_ZERO for a fragment with p = 0.
static inline float slot_beta(const Pixel q, const Fragments f, int slot) {
  if (slot < 0) return q.barrier.background;
  const uint k = fragment_at(q.run, f, slot);
  const float log_p = f.log_occupancy[k];
  return log_p > DPR_LOG_ZERO ? barrier_beta(q.barrier, f.depth[k], log_p) : DPR_LOG_ZERO;
}

static inline Pixel load_pixel(const AggregateParams p, uint pixel, global const ViewParams* restrict views,
                               global const uint* restrict starts, const Fragments f) {
  Pixel q;
  q.run = locate_run(p, pixel, starts);
  q.barrier = load_barrier_pixel(p, pixel, views, starts, f);
  float largest = q.barrier.background;
  for (int slot = 0; slot < run_length(q.run); ++slot) {
    const float beta = slot_beta(q, f, slot);
    if (beta <= largest) continue;
    largest = beta;
    q.run.rigid = slot;
  }
  return q;
}

static inline NoiseName slot_noise(const AggregateParams p, const Pixel q, const Fragments f,
                                   const FaceOf face, int slot) {
  const uint index =
      slot < 0 ? DPR_BACKGROUND_FACE : face_of_fragment(p, q.run, face, fragment_at(q.run, f, slot));
  return name_of_noise(p, q.run, index, DPR_STAGE_AGGREGATE);
}

/// The leading slots of a block's samples.
typedef struct {
  intn winner;
  realn largest;
} Lead;

/// True if a slot could win in any sample of the block. It could not where its largest noise were too little.
static inline int could_win(const Lead lead, float beta) {
  return beta > DPR_LOG_ZERO && any_lane(beta + highest_noise(DPR_PRIOR) >= lead.largest);
}

/// A block's winners. The rigid one goes first: beside it most of the others need no noise. What is drawn for
/// slot k stays in cache[k + 1], as far as it reaches.
static inline Lead find_winners(const AggregateParams p, const Pixel q, const Fragments f, const FaceOf face,
                                uint block, realn cache[DPR_NOISE_CACHE]) {
  Lead lead;
  lead.winner = (intn)(q.run.rigid);
  lead.largest = (realn)(-INFINITY);
  for (int turn = -2; turn < run_length(q.run); ++turn) {
    if (turn == q.run.rigid) continue;
    const int slot = turn == -2 ? q.run.rigid : turn;
    const float beta = slot_beta(q, f, slot);
    if (!could_win(lead, beta)) continue;
    const realn noise = draw_noise(p.sampling, DPR_PRIOR, slot_noise(p, q, f, face, slot), block);
    if (is_kept(slot + 1)) cache[slot + 1] = noise;
    const realn value = beta + noise;
    lead.winner = select(lead.winner, (intn)(slot), value > lead.largest);
    lead.largest = greater(value, lead.largest);
  }
  return lead;
}

/// One work-item per pixel. Deterministic. Arguments as aggregate_forward, and
/// in   fragment_pair  uint[fragment],  pair_face  uint[pair]   name the noise of a fragment
kernel void aggregate_sampled_forward(const AggregateParams p, global const ViewParams* restrict views,
                                      global const uint* restrict starts, global const uint* restrict list,
                                      global const float* restrict fragments,
                                      global const uint* restrict fragment_pair,
                                      global const uint* restrict pair_face, global float4* restrict image) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= p.last_pixel) return;
  if (starts[pixel] == starts[pixel + 1]) {
    image[pixel] = (float4)(p.background.xyz, 0.0f);
    return;
  }
  const Fragments f = make_fragments(p, list, fragments);
  const FaceOf face = {fragment_pair, pair_face};
  const Pixel q = load_pixel(p, pixel, views, starts, f);
  float4 sum = 0.0f;
  for (uint block = 0; DPR_WIDTH * block < p.sampling.samples; ++block) {
    realn unused[DPR_NOISE_CACHE];
    sum = add_winners(p, q.run, f, block, find_winners(p, q, f, face, block, unused).winner, sum);
  }
  image[pixel] = (float4)(sum.xyz / (float)p.sampling.samples, 1.0f - q.barrier.transparency);
}

/// Collects the scores of all samples: in `weight` the numbers of wins, in the other two the sums of every
/// slot. Returns sum y.
static inline float add_samples(const AggregateParams p, const Pixel q, const Fragments f, const FaceOf face,
                                float4 grad, global float* weight, global float* by_score,
                                global float* score_sum, ScaleSums* gamma) {
  float y_sum = 0.0f;
  for (uint i = q.run.first; i < q.run.last; ++i) {
    weight[f.list[i]] = by_score[f.list[i]] = score_sum[f.list[i]] = 0.0f;
  }
  const float rigid = rigid_value(p, q.run, f, grad);
  for (uint block = 0; DPR_WIDTH * block < p.sampling.samples; ++block) {
    realn cache[DPR_NOISE_CACHE];
    const Lead lead = find_winners(p, q, f, face, block, cache);
    const realn y = sample_values(p, q.run, f, grad, rigid, block, lead.winner, weight);
    if (p.sampling.leave_out == 0.0f && !any_lane(y != 0.0f)) continue;
    const realn grouped = add_group(p.sampling, y);
    y_sum += sum_lanes(y);
    for (int slot = -1; slot < run_length(q.run); ++slot) {
      if (!could_win(lead, slot_beta(q, f, slot))) continue;
      const realn noise = is_kept(slot + 1)
                              ? cache[slot + 1]
                              : draw_noise(p.sampling, DPR_PRIOR, slot_noise(p, q, f, face, slot), block);
      const realn noise_scores = noise_score(DPR_PRIOR, noise);
      const float2 scores = add_scores(noise, noise_scores, sample_counts(p.sampling, block), grouped, gamma);
      if (slot < 0) continue;
      by_score[fragment_at(q.run, f, slot)] += scores.x;
      score_sum[fragment_at(q.run, f, slot)] += scores.y;
    }
  }
  return y_sum;
}

/// One work-item per pixel. Deterministic. Inputs as aggregate_sampled_forward, gradients as
/// aggregate_backward.
kernel void aggregate_sampled_backward(const AggregateParams p, global const ViewParams* restrict views,
                                       global const uint* restrict starts, global const uint* restrict list,
                                       global const float* restrict fragments,
                                       global const uint* restrict fragment_pair,
                                       global const uint* restrict pair_face,
                                       global const float4* restrict grad_image, global float* restrict grads,
                                       global float* restrict channels) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= p.last_pixel) return;
  const Fragments f = make_fragments(p, list, fragments);
  const FaceOf face = {fragment_pair, pair_face};
  const float4 grad = grad_image[pixel];
  float grad_gamma = 0.0f, grad_alpha = 0.0f, background_weight = 1.0f;
  if (starts[pixel] != starts[pixel + 1]) {
    const Pixel q = load_pixel(p, pixel, views, starts, f);
    const FragmentGradients g = make_gradients(p, grads);
    ScaleSums gamma = {(realn)(0.0f), (realn)(0.0f)};
    // The alpha is not sampled: y is of the colour alone.
    const float4 grad_color = (float4)(grad.xyz, 0.0f);
    const float y_sum = add_samples(p, q, f, face, grad_color, g.red, g.depth, g.log_occupancy, &gamma);
    grad_gamma = scale_estimate(p.sampling, gamma, y_sum) / p.gamma;
    for (uint i = q.run.first; i < q.run.last; ++i) {
      const uint k = list[i];
      const float weight = g.red[k] / (float)p.sampling.samples;
      const float grad_beta = score_estimate(p.sampling, g.depth[k], g.log_occupancy[k], y_sum);
      background_weight -= weight;
      store_color(g, k, weight, grad);
      g.depth[k] = -grad_beta * q.barrier.depth_scale;
      g.log_occupancy[k] =
          grad_beta * q.barrier.inverse_alpha + grad.w * alpha_sensitivity(f, k, q.barrier.transparency);
      const float log_p = f.log_occupancy[k];
      if (log_p <= DPR_LOG_ZERO) continue;
      // b = zeta + (gamma / alpha) ln p depends on gamma and alpha by itself.
      grad_gamma += grad_beta * log_p * q.barrier.inverse_alpha / p.gamma;
      grad_alpha -= grad_beta * log_p * q.barrier.inverse_alpha * q.barrier.inverse_alpha;
    }
  }
  write_channels(p, pixel, grad_gamma, grad_alpha, background_weight, grad, channels);
}
