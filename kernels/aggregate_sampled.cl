// The perturbed arg-max by Monte Carlo with a control variate, for the barrier composition: eq. (9)-(16). Each sample
// perturbs every slot's beta, the largest wins, the pixel takes its colour. Four samples at a time: the four words of
// one Philox call. The backward pass draws the forward pass' noise again, so nothing is stored, and memory does not
// depend on the number of samples. A fragment with p = 0 is no slot: no noise is drawn for it.
//
//   dL/dbeta_k       = 1/M sum_m (g_winner(m) - baseline g_rigid) nu'(Z_km)                        (12), (14)
//   dL/dgamma at b   = 1/M sum_m (g_winner(m) - baseline g_rigid) (sum_k nu'(Z_km) Z_km - d) / gamma
//
// with d the number of slots: the change of variables has the determinant gamma^-d.
#define DPR_WIDTH 4
#include "philox.h"
#include "pixel.h"
#include "priors.h"

/// The face index that names the background's noise.
#define DPR_BACKGROUND_FACE 0xffffffffu

/// What a pixel's slots have in common.
typedef struct {
  uint first, last;   // the pixel's run of the fragment lists
  uint view, in_view; // the pixel's view, and its number in it
  float nearest;      // view depth of the nearest fragment
  float depth_scale;  // d beta / d (nearest - depth)
  float inverse_alpha;
  float background;   // beta of the background slot
} Pixel;

/// What says which face's noise a fragment takes.
typedef struct {
  global const uint *fragment_pair, *pair_face;
} FaceOf;

static inline Pixel load_pixel(const AggregateParams p, uint pixel, global const ViewParams* restrict views,
                               global const uint* restrict starts, const Fragments f) {
  Pixel q;
  q.view = pixel / p.pixels_per_view;
  q.in_view = pixel - q.view * p.pixels_per_view;
  global const ViewParams* view = views + q.view;
  q.first = starts[pixel];
  q.last = starts[pixel + 1];
  q.nearest = INFINITY;
  for (uint i = q.first; i < q.last; ++i) q.nearest = min(q.nearest, f.depth[f.list[i]]);
  q.depth_scale = view->inverse_range / p.gamma;
  q.inverse_alpha = 1.0f / p.alpha;
  q.background = (p.background_depth - (view->zfar - q.nearest) * view->inverse_range) / p.gamma;
  return q;
}

static inline float depth_beta(const Pixel q, float depth) { return (q.nearest - depth) * q.depth_scale; }
static inline float slot_beta(const Pixel q, const Fragments f, uint k) {
  return depth_beta(q, f.depth[k]) + f.log_occupancy[k] * q.inverse_alpha;
}

static inline realn draw_noise(const AggregateParams p, const Pixel q, uint face, uint block) {
  const uint4 counter = (uint4)(q.in_view, face, block, (p.first_view + q.view) << 1 | DPR_STAGE_AGGREGATE);
  return prior_sample(uniform_from_bits(philox4x32_10(counter, (uint2)(p.seed_low, p.seed_high))));
}

static inline uint face_of(const AggregateParams p, const FaceOf face, uint fragment) {
  return face.pair_face[face.fragment_pair[fragment]] % p.faces;
}

/// The winners of a block of samples: a fragment each, or -1 for the background. `scores` are sum_k nu'(Z_km) Z_km - d.
static inline intn sample_winners(const AggregateParams p, const Pixel q, const Fragments f, const FaceOf face,
                                  uint block, realn* scores) {
  const realn noise = draw_noise(p, q, DPR_BACKGROUND_FACE, block);
  realn largest = q.background + noise;
  *scores = mad(prior_score(noise), noise, -1.0f);
  intn winner = -1;
  for (uint i = q.first; i < q.last; ++i) {
    const uint k = f.list[i];
    if (f.log_occupancy[k] <= DPR_LOG_ZERO) continue;
    const realn z = draw_noise(p, q, face_of(p, face, k), block);
    const realn value = slot_beta(q, f, k) + z;
    winner = select(winner, (intn)((int)k), value > largest);
    largest = max(largest, value);
    *scores += mad(prior_score(z), z, -1.0f);
  }
  return winner;
}

/// The winner without noise.
static inline int rigid_winner(const Pixel q, const Fragments f) {
  float largest = q.background;
  int winner = -1;
  for (uint i = q.first; i < q.last; ++i) {
    const uint k = f.list[i];
    if (f.log_occupancy[k] <= DPR_LOG_ZERO || slot_beta(q, f, k) <= largest) continue;
    largest = slot_beta(q, f, k);
    winner = (int)k;
  }
  return winner;
}

static inline float3 winner_color(const AggregateParams p, const Fragments f, int winner) {
  return winner < 0 ? p.background.xyz : fragment_color(f, (uint)winner);
}

/// One work-item per pixel. Buffers as in aggregate.cl, and
/// in   fragment_pair  uint[fragment],  pair_face  uint[pair]   name the noise of a fragment
kernel void aggregate_sampled_forward(const AggregateParams p, global const ViewParams* restrict views,
                                      global const uint* restrict starts, global const uint* restrict list,
                                      global const float* restrict depth, global const float* restrict log_occupancy,
                                      global const float* restrict occupancy, global const float* restrict red,
                                      global const float* restrict green, global const float* restrict blue,
                                      global const uint* restrict fragment_pair, global const uint* restrict pair_face,
                                      global float4* restrict image) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= p.pixels) return;
  if (starts[pixel] == starts[pixel + 1]) {
    image[pixel] = (float4)(p.background.xyz, 0.0f);
    return;
  }
  const Fragments f = make_fragments(list, depth, log_occupancy, occupancy, red, green, blue);
  const FaceOf face = {fragment_pair, pair_face};
  const Pixel q = load_pixel(p, pixel, views, starts, f);
  float3 sum = 0.0f;
  for (uint block = 0; DPR_WIDTH * block < p.samples; ++block) {
    realn scores;
    int winners[DPR_WIDTH];
    store_n(sample_winners(p, q, f, face, block, &scores), 0, winners);
    for (uint lane = 0; lane < DPR_WIDTH && DPR_WIDTH * block + lane < p.samples; ++lane) {
      sum += winner_color(p, f, winners[lane]);
    }
  }
  image[pixel] = (float4)(sum / (float)p.samples, 1.0f - run_transparency(f, q.first, q.last));
}

/// Adds a block of samples to the gradients: 1 to the weight of each winner, excess * nu'(Z) to every slot's dL/dbeta.
static inline void add_block(const AggregateParams p, const Pixel q, const Fragments f, const FaceOf face, uint block,
                             const int winners[DPR_WIDTH], realn excess, global float* weight,
                             global float* grad_beta) {
  for (uint lane = 0; lane < DPR_WIDTH && DPR_WIDTH * block + lane < p.samples; ++lane) {
    if (winners[lane] >= 0) weight[winners[lane]] += 1.0f;
  }
  for (uint i = q.first; i < q.last; ++i) {
    const uint k = f.list[i];
    if (f.log_occupancy[k] <= DPR_LOG_ZERO) continue;
    grad_beta[k] += sum_lanes(excess * prior_score(draw_noise(p, q, face_of(p, face, k), block)));
  }
}

/// One work-item per pixel. Buffers as in aggregate.cl and aggregate_sampled_forward.
kernel void aggregate_sampled_backward(const AggregateParams p, global const ViewParams* restrict views,
                                       global const uint* restrict starts, global const uint* restrict list,
                                       global const float* restrict depth, global const float* restrict log_occupancy,
                                       global const float* restrict occupancy, global const float* restrict red,
                                       global const float* restrict green, global const float* restrict blue,
                                       global const uint* restrict fragment_pair, global const uint* restrict pair_face,
                                       global const float4* restrict grad_image, global float* restrict grad_depth,
                                       global float* restrict grad_log_occupancy, global float* restrict grad_red,
                                       global float* restrict grad_green, global float* restrict grad_blue,
                                       global float* restrict channels) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= p.pixels) return;
  const Fragments f = make_fragments(list, depth, log_occupancy, occupancy, red, green, blue);
  const FaceOf face = {fragment_pair, pair_face};
  const float4 grad = grad_image[pixel];
  float grad_gamma = 0.0f, grad_alpha = 0.0f, background_weight = 1.0f;
  if (starts[pixel] != starts[pixel + 1]) {
    const Pixel q = load_pixel(p, pixel, views, starts, f);
    for (uint i = q.first; i < q.last; ++i) grad_red[list[i]] = grad_depth[list[i]] = 0.0f;
    const float rigid = p.baseline * dot(grad.xyz, winner_color(p, f, rigid_winner(q, f)));
    float by_gamma = 0.0f;
    for (uint block = 0; DPR_WIDTH * block < p.samples; ++block) {
      realn scores;
      int winners[DPR_WIDTH];
      store_n(sample_winners(p, q, f, face, block, &scores), 0, winners);
      float lanes[DPR_WIDTH];
      for (uint lane = 0; lane < DPR_WIDTH; ++lane) {
        const int counts = DPR_WIDTH * block + lane < p.samples;
        lanes[lane] = counts ? dot(grad.xyz, winner_color(p, f, winners[lane])) - rigid : 0.0f;
      }
      const realn excess = load_n(0, lanes);
      by_gamma += sum_lanes(excess * scores);
      add_block(p, q, f, face, block, winners, excess, grad_red, grad_depth);
    }
    const float share = 1.0f / (float)p.samples;
    const float transparency = run_transparency(f, q.first, q.last);
    grad_gamma = by_gamma * share / p.gamma;
    for (uint i = q.first; i < q.last; ++i) {
      const uint k = list[i];
      const float weight = grad_red[k] * share, grad_beta = grad_depth[k] * share;
      background_weight -= weight;
      grad_red[k] = weight * grad.x;
      grad_green[k] = weight * grad.y;
      grad_blue[k] = weight * grad.z;
      grad_depth[k] = -grad_beta * q.depth_scale;
      grad_log_occupancy[k] = grad_beta * q.inverse_alpha + grad.w * alpha_sensitivity(f, k, transparency);
      if (log_occupancy[k] <= DPR_LOG_ZERO) continue;
      // b = zeta + (gamma / alpha) ln p depends on gamma and alpha by itself.
      grad_gamma += grad_beta * log_occupancy[k] * q.inverse_alpha / p.gamma;
      grad_alpha -= grad_beta * log_occupancy[k] * q.inverse_alpha * q.inverse_alpha;
    }
  }
  write_channels(p, pixel, grad_gamma, grad_alpha, background_weight, grad, channels);
}
