// The perturbed arg-max over a pixel's fragments and the background, exactly, for the barrier composition:
// w = E[argmax <beta + Z, y>] with beta = b / gamma, b = zeta + (gamma / alpha) ln p, eq. (7), (9), (10).
//
//   w_j         = integral P r_j dt,  P = prod_k F(t - beta_k),  r_j = f(t - beta_j) / F(t - beta_j)
//   dL/dbeta_k  = integral P r_k (g_k R - G) dt,  g_k = <dL/dcolour, C_k>,  R = sum r_j,  G = sum g_j r_j
//
// with the same quadrature nodes t for every fragment: one pass over the fragments for the image, two for the gradients.
// The weights sum to 1, so dividing by the quadrature's own sum removes most of its error. The Gumbel prior needs no
// quadrature: its weights are the softmax (40). All betas are differences to the pixel's nearest fragment: zeta / gamma
// itself would waste its bits. Errors: tests/stages/aggregate_test.cpp.
#ifndef DPR_NODE_LANES
#define DPR_NODE_LANES 16
#endif
#define DPR_WIDTH DPR_NODE_LANES /* lanes are quadrature nodes */
#include "pixel.h"
#include "priors.h"
#include "quadrature.h"

/// What a pixel's slots have in common.
typedef struct {
  uint first, last;     // the pixel's run of the fragment lists
  float nearest;        // view depth of the nearest fragment
  float depth_scale;    // d beta / d (nearest - depth)
  float inverse_alpha;
  float background;     // beta of the background slot
  float largest;        // the largest beta, the background's too
  uint crowd;           // slots that count
  float depth_origin, log_origin;  // what depth and ln p add to the largest beta
} Pixel;

/// What depth adds to beta, and beta itself. A fragment with p = 0 is far below all others.
static inline float depth_beta(const Pixel q, float depth) { return (q.nearest - depth) * q.depth_scale; }
static inline float slot_beta(const Pixel q, const Fragments f, uint fragment) {
  const float log_p = f.log_occupancy[fragment];
  return log_p > DPR_LOG_ZERO ? depth_beta(q, f.depth[fragment]) + log_p * q.inverse_alpha : DPR_LOG_ZERO;
}

/// Slots further below the largest than the prior reaches have no weight, and change no other's.
static inline int slot_counts(const Pixel q, float beta) {
  return beta > DPR_LOG_ZERO && beta > q.largest - DPR_BARRIER_REACH;
}

static inline Pixel load_pixel(const AggregateParams p, uint pixel, global const ViewParams* restrict views,
                               global const uint* restrict starts, const Fragments f) {
  global const ViewParams* view = views + pixel / p.pixels_per_view;
  Pixel q;
  q.first = starts[pixel];
  q.last = starts[pixel + 1];
  q.nearest = INFINITY;
  for (uint i = q.first; i < q.last; ++i) q.nearest = min(q.nearest, f.depth[f.list[i]]);
  q.depth_scale = view->inverse_range / p.gamma;
  q.inverse_alpha = 1.0f / p.alpha;
  q.background = (p.background_depth - (view->zfar - q.nearest) * view->inverse_range) / p.gamma;
  q.largest = q.background;
  q.depth_origin = q.background;
  q.log_origin = 0.0f;
  for (uint i = q.first; i < q.last; ++i) {
    const uint k = f.list[i];
    const float beta = slot_beta(q, f, k);
    if (beta <= q.largest) continue;
    q.largest = beta;
    q.depth_origin = depth_beta(q, f.depth[k]);
    q.log_origin = f.log_occupancy[k];
  }
  q.crowd = slot_counts(q, q.background) ? 1 : 0;
  for (uint i = q.first; i < q.last; ++i) q.crowd += slot_counts(q, slot_beta(q, f, f.list[i])) ? 1 : 0;
  return q;
}

#if DPR_PRIOR == DPR_CAUCHY

/// The largest beta below `limit`, or -INFINITY.
static inline float next_head(const Pixel q, const Fragments f, float limit) {
  float head = q.background < limit ? q.background : -INFINITY;
  for (uint i = q.first; i < q.last; ++i) {
    const float beta = slot_beta(q, f, f.list[i]);
    if (beta < limit && beta > DPR_LOG_ZERO) head = max(head, beta);
  }
  return head;
}

/// The next stretch of the integral, from the largest beta down; false after the last. Heavy tails make every cluster
/// of slots matter: each has a segment of its own, up to half way to its neighbours.
static inline int next_segment(const Pixel q, const Fragments f, int first, float* head, Segment* s) {
  if (first) *head = q.largest;
  if (!(*head > -INFINITY)) return 0;
  const float next = next_head(q, f, *head - DPR_CLUSTER);
  s->high = asinh(first ? DPR_CAUCHY_REACH : 0.5f * (s->centre - *head));
  s->low = -asinh(next > -INFINITY ? 0.5f * (*head - next) : DPR_CAUCHY_REACH);
  s->centre = *head;
  s->blocks = DPR_CLUSTER_NODES / DPR_WIDTH;
  *head = next;
  return 1;
}

#elif DPR_PRIOR != DPR_GUMBEL

/// The one stretch of the integral, around the largest beta.
static inline int next_segment(const Pixel q, const Fragments f, int first, float* head, Segment* s) {
  (void)f;
  (void)head;
  const int crowded = q.crowd > DPR_CROWD;
  s->centre = q.largest;
  s->low = crowded ? DPR_CROWD_LOW : DPR_BARRIER_LOW;
  s->high = crowded ? DPR_CROWD_HIGH : DPR_BARRIER_HIGH;
  s->blocks = (crowded ? DPR_CROWD_NODES : DPR_BARRIER_NODES) / DPR_WIDTH;
  if (q.crowd > DPR_THRONG) s->blocks *= 2;
  return first;
}

#endif

#if DPR_PRIOR == DPR_GUMBEL

/// Sum of the weights times (colour, 1): softmax.
static inline float4 weigh_colors(const Pixel q, const Fragments f, float3 background) {
  float4 sum = exp(q.background - q.largest) * (float4)(background, 1.0f);
  for (uint i = q.first; i < q.last; ++i) {
    const uint k = f.list[i];
    sum += exp(slot_beta(q, f, k) - q.largest) * (float4)(fragment_color(f, k), 1.0f);
  }
  return sum;
}

#else

/// Sums over the slots at a block of nodes: P, R, and sum r_j C_j.
typedef struct {
  realn product, ratio, red, green, blue;
} NodeSums;

static inline void add_slot(realn x, float3 color, NodeSums* s) {
  realn cdf, ratio;
  prior_cdf_ratio(x, &cdf, &ratio);
  s->product *= cdf;
  s->ratio += ratio;
  s->red += ratio * color.x;
  s->green += ratio * color.y;
  s->blue += ratio * color.z;
}

/// Sum of the weights times (colour, 1).
static inline float4 weigh_colors(const Pixel q, const Fragments f, float3 background) {
  float4 sum = 0.0f;
  float head = 0.0f;
  Segment segment;
  for (int first = 1; next_segment(q, f, first, &head, &segment); first = 0) {
    for (uint block = 0; block < segment.blocks; ++block) {
      realn t, weight;
      segment_nodes(segment, block, &t, &weight);
      NodeSums s = {(realn)(1.0f), (realn)(0.0f), (realn)(0.0f), (realn)(0.0f), (realn)(0.0f)};
      if (slot_counts(q, q.background)) add_slot(t - q.background, background, &s);
      for (uint i = q.first; i < q.last; ++i) {
        const uint k = f.list[i];
        const float beta = slot_beta(q, f, k);
        if (slot_counts(q, beta)) add_slot(t - beta, fragment_color(f, k), &s);
      }
      const realn mass = weight * s.product;
      sum += (float4)(sum_lanes(mass * s.red), sum_lanes(mass * s.green), sum_lanes(mass * s.blue),
                      sum_lanes(mass * s.ratio));
    }
  }
  return sum;
}

#endif

/// One work-item per pixel. Deterministic.
/// in   starts  uint[pixel + 1]  runs of `list`
/// in   list    uint[...]        fragments, by pixel
/// in   depth, log_occupancy, occupancy, red, green, blue  float[fragment]
/// out  image   float4[pixel]    colour, and alpha = 1 - prod (1 - p)
kernel void aggregate_forward(const AggregateParams p, global const ViewParams* restrict views,
                              global const uint* restrict starts, global const uint* restrict list,
                              global const float* restrict depth, global const float* restrict log_occupancy,
                              global const float* restrict occupancy, global const float* restrict red,
                              global const float* restrict green, global const float* restrict blue,
                              global float4* restrict image) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= p.pixels) return;
  const float3 background = p.background.xyz;
  if (starts[pixel] == starts[pixel + 1]) {
    image[pixel] = (float4)(background, 0.0f);
    return;
  }
  const Fragments f = make_fragments(list, depth, log_occupancy, occupancy, red, green, blue);
  const Pixel q = load_pixel(p, pixel, views, starts, f);
  const float4 sum = weigh_colors(q, f, background);
  image[pixel] = (float4)(sum.xyz / sum.w, 1.0f - run_transparency(f, q.first, q.last));
}

/// Where the gradients of a pixel's slots collect before they are scaled: weights w_k and dL/dbeta_k.
typedef struct {
  global float *weight, *grad_beta;     // float[fragment]
  float background_weight, grad_background_beta;
} SlotGradients;

#if DPR_PRIOR == DPR_GUMBEL

/// w_k by softmax, dL/dbeta_k = w_k (g_k - sum w g). `g` are relative to the background's. Returns the sum of weights.
static inline float weigh_gradients(const Pixel q, const Fragments f, float3 grad, float3 background,
                                    SlotGradients* out) {
  float total = exp(q.background - q.largest), mean = 0.0f;
  out->background_weight = total;
  for (uint i = q.first; i < q.last; ++i) {
    const uint k = f.list[i];
    const float weight = exp(slot_beta(q, f, k) - q.largest);
    out->weight[k] = weight;
    total += weight;
    mean += weight * dot(grad, fragment_color(f, k) - background);
  }
  mean /= total;
  out->grad_background_beta = -out->background_weight * mean;
  for (uint i = q.first; i < q.last; ++i) {
    const uint k = f.list[i];
    out->grad_beta[k] = out->weight[k] * (dot(grad, fragment_color(f, k) - background) - mean);
  }
  return total;
}

#else

/// One slot at a block of nodes: adds to its weight and to dL/dbeta.
static inline float2 slot_gradient(realn x, realn mass, realn ratio_sum, realn grad_sum, float g) {
  realn cdf, ratio;
  prior_cdf_ratio(x, &cdf, &ratio);
  const realn share = mass * ratio;
  return (float2)(sum_lanes(share), sum_lanes(share * (g * ratio_sum - grad_sum)));
}

/// The integrals of w_k and dL/dbeta_k. `g` are relative to the background's. Returns the sum of weights.
static inline float weigh_gradients(const Pixel q, const Fragments f, float3 grad, float3 background,
                                    SlotGradients* out) {
  for (uint i = q.first; i < q.last; ++i) out->weight[f.list[i]] = out->grad_beta[f.list[i]] = 0.0f;
  out->background_weight = out->grad_background_beta = 0.0f;
  float total = 0.0f, head = 0.0f;
  Segment segment;
  for (int first = 1; next_segment(q, f, first, &head, &segment); first = 0) {
    for (uint block = 0; block < segment.blocks; ++block) {
      realn t, weight;
      segment_nodes(segment, block, &t, &weight);
      realn product = 1.0f, ratio_sum = 0.0f, grad_sum = 0.0f, cdf, ratio;
      const int background_counts = slot_counts(q, q.background);
      if (background_counts) prior_cdf_ratio(t - q.background, &product, &ratio_sum);
      for (uint i = q.first; i < q.last; ++i) {
        const float beta = slot_beta(q, f, f.list[i]);
        if (!slot_counts(q, beta)) continue;
        prior_cdf_ratio(t - beta, &cdf, &ratio);
        product *= cdf;
        ratio_sum += ratio;
        grad_sum += ratio * dot(grad, fragment_color(f, f.list[i]) - background);
      }
      const realn mass = weight * product;
      total += sum_lanes(mass * ratio_sum);
      if (background_counts) {
        const float2 slot = slot_gradient(t - q.background, mass, ratio_sum, grad_sum, 0.0f);
        out->background_weight += slot.x;
        out->grad_background_beta += slot.y;
      }
      for (uint i = q.first; i < q.last; ++i) {
        const uint k = f.list[i];
        const float beta = slot_beta(q, f, k);
        if (!slot_counts(q, beta)) continue;
        const float g = dot(grad, fragment_color(f, k) - background);
        const float2 slot = slot_gradient(t - beta, mass, ratio_sum, grad_sum, g);
        out->weight[k] += slot.x;
        out->grad_beta[k] += slot.y;
      }
    }
  }
  return total;
}

#endif

/// One work-item per pixel; every fragment belongs to one pixel, so no two write the same place. Deterministic.
/// in   grad_image  float4[pixel]
/// out  grad_depth, grad_log_occupancy, grad_red, grad_green, grad_blue  float[fragment]
/// out  channels    float[DPR_PIXEL_CHANNELS][pixel]  what the pixel adds to gamma, alpha and the background colour
kernel void aggregate_backward(const AggregateParams p, global const ViewParams* restrict views,
                               global const uint* restrict starts, global const uint* restrict list,
                               global const float* restrict depth, global const float* restrict log_occupancy,
                               global const float* restrict occupancy, global const float* restrict red,
                               global const float* restrict green, global const float* restrict blue,
                               global const float4* restrict grad_image, global float* restrict grad_depth,
                               global float* restrict grad_log_occupancy, global float* restrict grad_red,
                               global float* restrict grad_green, global float* restrict grad_blue,
                               global float* restrict channels) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= p.pixels) return;
  const Fragments f = make_fragments(list, depth, log_occupancy, occupancy, red, green, blue);
  const float4 grad = grad_image[pixel];
  float grad_gamma = 0.0f, grad_alpha = 0.0f, background_weight = 1.0f;
  if (starts[pixel] != starts[pixel + 1]) {
    const Pixel q = load_pixel(p, pixel, views, starts, f);
    SlotGradients g;
    g.weight = grad_red;
    g.grad_beta = grad_depth;
    const float scale = 1.0f / weigh_gradients(q, f, grad.xyz, p.background.xyz, &g);
    const float transparency = run_transparency(f, q.first, q.last);
    background_weight = g.background_weight * scale;
    // d beta / d gamma = -(beta by depth) / gamma; d beta / d alpha = -ln p / alpha^2. Shifting all betas changes
    // nothing, so both count from the largest slot, where the gradients are: from elsewhere their errors would be
    // multiplied by the distance.
    const float to_alpha = -q.inverse_alpha * q.inverse_alpha;
    grad_gamma = (q.depth_origin - q.background) * g.grad_background_beta * scale / p.gamma;
    grad_alpha = -q.log_origin * g.grad_background_beta * scale * to_alpha;
    for (uint i = q.first; i < q.last; ++i) {
      const uint k = list[i];
      const float weight = grad_red[k] * scale, grad_beta = grad_depth[k] * scale;
      grad_red[k] = weight * grad.x;
      grad_green[k] = weight * grad.y;
      grad_blue[k] = weight * grad.z;
      grad_depth[k] = -grad_beta * q.depth_scale;
      grad_log_occupancy[k] = grad_beta * q.inverse_alpha + grad.w * alpha_sensitivity(f, k, transparency);
      grad_gamma += grad_beta * (q.depth_origin - depth_beta(q, depth[k])) / p.gamma;
      if (log_occupancy[k] > DPR_LOG_ZERO) grad_alpha += grad_beta * (log_occupancy[k] - q.log_origin) * to_alpha;
    }
  }
  write_channels(p, pixel, grad_gamma, grad_alpha, background_weight, grad, channels);
}
