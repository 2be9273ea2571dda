// The perturbed arg-max over a pixel's fragments and the background, exactly, for the barrier composition:
// w = E[argmax <beta + Z, y>] with beta = b / gamma, b = zeta + (gamma / alpha) ln p, eq. (7), (9), (10).
//
// The forward pass gathers the slots that count, and integrates (integrate.h). The weights sum to 1, so
// dividing by the quadrature's own sum removes most of its error. A slot alone needs no integral, nor do two
// and three of Gaussian noise (triple.h), nor the Gumbel prior, whose weights are the softmax (40). Errors:
// tests/stages/aggregate_test.cpp.
#ifndef DPR_LANES
#define DPR_LANES 8
#endif
#if DPR_LANES == 1
#define DPR_WIDTH 4 /* nodes of a work-item, which adds to its slots' sums in memory once for them */
#else
#define DPR_WIDTH 16 /* lanes are quadrature nodes */
#endif
#include "integrate.h"
#include "triple.h"

/// The slots that count, the largest first; betas relative to it. Slots further below than the prior reaches
/// have no weight, and change no other's. Everything is written, and what does not count written over: no
/// branch to mispredict.
DPR_ALWAYS_INLINE void gather_run(const BarrierPixel q, uint length, const Fragments f, global Slot* slots,
                                  Slots* out) {
  const Slot background = {q.background, 1.0f, 0.0f, DPR_BACKGROUND_SLOT};
  slots[0] = background;
  float largest = q.background;
  DPR_UNROLL_ON_CPU
  for (uint i = 0; i < length; ++i) {
    const uint k = f.list[q.first + i];
    const float log_p = f.log_occupancy[k];
    const float beta = log_p > DPR_LOG_ZERO ? barrier_beta(q, f.depth[k], log_p) : -INFINITY;
    const Slot s = {beta, 1.0f, 0.0f, k};
    slots[1 + i] = s;
    largest = beta > largest ? beta : largest;
  }
  Slots run = {slots, 0, 0.0f};
  uint front = 0;
  Nearby nearby = no_slots();
  DPR_UNROLL_ON_CPU
  for (uint i = 0; i <= length; ++i) {
    Slot s = slots[i];
    s.beta -= largest;
    slots[run.count] = s;
    front = s.beta == 0.0f ? run.count : front;
    run.count += s.beta > -DPR_BARRIER_REACH;
    add_nearby(s.beta, &nearby);
  }
  swap_slots(slots, slots + front);
  slots[0].occupancy = lower_end(nearby);
  *out = run;
}

/// Gathers the pixel's slots and the product of 1 - p, which its fragments leave of the light behind them.
DPR_ALWAYS_INLINE void gather_pixel(const AggregateParams p, uint pixel, uint length,
                                    global const ViewParams* views, global const uint* starts,
                                    const Fragments f, global Slot* slots, Slots* run, float* transparency) {
  BarrierPixel q;
  load_barrier_run(p, pixel, length, views, starts, f, &q);
  *transparency = q.transparency;
  gather_run(q, length, f, slots + q.first + pixel, run);
}

/// A copy of gather_pixel() for runs of one length.
#define DPR_GATHER_RUN_OF(LENGTH)                                               \
  case LENGTH:                                                                  \
    gather_pixel(p, pixel, LENGTH, views, starts, f, slots, run, transparency); \
    return

/// Short runs each by a copy of their own, which a CPU unrolls.
static inline void gather_slots(const AggregateParams p, uint pixel, global const ViewParams* restrict views,
                                global const uint* restrict starts, const Fragments f, global Slot* slots,
                                Slots* run, float* transparency) {
  const uint length = starts[pixel + 1] - starts[pixel];
  switch (DPR_LANES == 1 ? 0 : length) {
    DPR_GATHER_RUN_OF(1);
    DPR_GATHER_RUN_OF(2);
    DPR_GATHER_RUN_OF(3);
    DPR_GATHER_RUN_OF(4);
    DPR_GATHER_RUN_OF(5);
    DPR_GATHER_RUN_OF(6);
    DPR_GATHER_RUN_OF(7);
    DPR_GATHER_RUN_OF(8);
    default:
      gather_pixel(p, pixel, length, views, starts, f, slots, run, transparency);
  }
}

#ifdef DPR_SOFTMAX

/// Sum of the weights times (colour, 1).
static inline float4 weigh_colors(const Slots run, const Fragments f, float3 background) {
  float4 sum = 0.0f;
  for (uint i = 0; i < run.count; ++i) {
    const Slot s = run.slot[i];
    sum += exp(s.beta) * (float4)(slot_color(s, f, background), 1.0f);
  }
  return sum;
}

/// Adds w_k and dL/dbeta_k = w_k (g_k - sum w g), both times the sum of the weights, which it returns.
static inline float weigh_gradients(const Slots run, SlotGradients* out) {
  float total = 0.0f, mean = 0.0f;
  for (uint i = 0; i < run.count; ++i) {
    const float weight = exp(run.slot[i].beta);
    total += weight;
    mean += weight * run.slot[i].grad;
  }
  mean /= total;
  for (uint i = 0; i < run.count; ++i) {
    const Slot s = run.slot[i];
    const float weight = exp(s.beta), by_beta = weight * (s.grad - mean);
    if (s.fragment == DPR_BACKGROUND_SLOT) {
      out->background_weight = weight;
      out->background_beta = by_beta;
    } else {
      out->weight[s.fragment] = weight;
      out->beta[s.fragment] = by_beta;
    }
  }
  return total;
}

/// Adds the slots' rows w_k and w_k (c_k - sum w c), both times the sum of the weights, which it returns.
static inline float weigh_rows(const Slots run, const Fragments f, float3 background, SlotRows* out) {
  const float4 sum = weigh_colors(run, f, background);
  const float3 mean = sum.xyz / sum.w;
  for (uint i = 0; i < run.count; ++i) {
    const Slot s = run.slot[i];
    const float weight = exp(s.beta);
    add_row(s.fragment, weight, weight * (slot_color(s, f, background) - mean), out);
  }
  return sum.w;
}

#else

static inline float4 weigh_colors(const Slots run, const Fragments f, float3 background) {
#ifdef DPR_TRIPLE
  if (run.count <= DPR_TRIPLE) return weigh_triple(run, f, background);
#endif
  return integrate_colors(run, f, background);
}

static inline float weigh_gradients(const Slots run, SlotGradients* out) {
#ifdef DPR_TRIPLE
  if (run.count <= DPR_TRIPLE) return triple_gradients(run, out);
#endif
  return integrate_gradients(run, out).x;
}

static inline float weigh_rows(const Slots run, const Fragments f, float3 background, SlotRows* out) {
#ifdef DPR_TRIPLE
  if (run.count <= DPR_TRIPLE) return triple_rows(run, f, background, out);
#endif
  return integrate_rows(run, f, background, out).w;
}

#endif

/// A slot alone has all of the weight, and no gradient.
static inline float weigh_only_slot(const Slots run, SlotGradients* out) {
  const uint k = run.slot[0].fragment;
  if (k == DPR_BACKGROUND_SLOT) {
    out->background_weight = 1.0f;
  } else {
    out->weight[k] = 1.0f;
  }
  return 1.0f;
}

/// A slot's view depth and ln p; the background's are those that give its beta.
static inline float slot_depth(const Slot s, const Fragments f, float background_depth) {
  return s.fragment == DPR_BACKGROUND_SLOT ? background_depth : f.depth[s.fragment];
}
static inline float slot_log(const Slot s, const Fragments f) {
  return s.fragment == DPR_BACKGROUND_SLOT ? 0.0f : f.log_occupancy[s.fragment];
}

/// One work-item per pixel. Deterministic.
/// in   views   ViewParams[view]
/// in   starts  uint[pixel + 1]  runs of `list`
/// in   list    uint[...]        fragments, by pixel
/// in   fragments  float[plane][fragment]  DEPTH, LOG_OCCUPANCY, OCCUPANCY, COLOR
/// out  slots       Slot[length of list + pixels]  for the backward pass; a pixel's begin at
///                                                 starts[pixel] + pixel
/// out  slot_counts uint[pixel]
/// out  image       float4[pixel]    colour, and alpha = 1 - prod (1 - p)
kernel void aggregate_forward(const AggregateParams p, global const ViewParams* restrict views,
                              global const uint* restrict starts, global const uint* restrict list,
                              global const float* restrict fragments, global Slot* restrict slots,
                              global uint* restrict slot_counts, global float4* restrict image) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= p.last_pixel) return;
  const float3 background = p.background.xyz;
  if (starts[pixel] == starts[pixel + 1]) {
    image[pixel] = (float4)(background, 0.0f);
    return;
  }
  const Fragments f = make_fragments(p, list, fragments);
  float transparency;
  Slots run;
  gather_slots(p, pixel, views, starts, f, slots, &run, &transparency);
  slot_counts[pixel] = run.count;
  float3 color = slot_color(run.slot[0], f, background);
  if (run.count > 1) {
    const float4 sum = weigh_colors(run, f, background);
    color = sum.xyz / sum.w;
  }
  image[pixel] = (float4)(color, 1.0f - transparency);
}

/// Clears a pixel's gradients, but for what alpha adds to those of ln p.
static inline void clear_gradients(const Fragments f, uint first, uint last, float grad_alpha_channel,
                                   const FragmentGradients g) {
  const float transparency = run_transparency(f, first, last);
  for (uint i = first; i < last; ++i) {
    const uint k = f.list[i];
    g.depth[k] = g.red[k] = g.green[k] = g.blue[k] = 0.0f;
    g.log_occupancy[k] = grad_alpha_channel * alpha_sensitivity(f, k, transparency);
  }
}

/// One work-item per pixel; every fragment belongs to one pixel, so no two write the same place.
/// Deterministic.
/// in   slots, slot_counts   as aggregate_forward left them; changed. The other inputs as there
/// in   grad_image  float4[pixel]
/// out  grads       float[plane][fragment]  of DEPTH, LOG_OCCUPANCY, COLOR
/// out  channels    float[DPR_PIXEL_CHANNELS][pixel]  what the pixel adds to gamma, alpha and the background
///                                                    colour
kernel void aggregate_backward(const AggregateParams p, global const ViewParams* restrict views,
                               global const uint* restrict starts, global const uint* restrict list,
                               global const float* restrict fragments, global Slot* restrict slots,
                               global const uint* restrict slot_counts,
                               global const float4* restrict grad_image, global float* restrict grads,
                               global float* restrict channels) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= p.last_pixel) return;
  const float4 grad = grad_image[pixel];
  float grad_gamma = 0.0f, grad_alpha = 0.0f, background_weight = 1.0f;
  const uint first = starts[pixel], last = starts[pixel + 1];
  if (first != last) {
    const Fragments f = make_fragments(p, list, fragments);
    const FragmentGradients g = make_gradients(p, grads);
    clear_gradients(f, first, last, grad.w, g);
    const Slots run = {slots + first + pixel, slot_counts[pixel], 0.0f};
    SlotGradients sums = {g.red, g.depth, 0, 0.0f, 0.0f};
    // A common shift of all g changes nothing: relative to the background's they keep their digits.
    for (uint i = 0; i < run.count; ++i) {
      run.slot[i].grad = dot(grad.xyz, slot_color(run.slot[i], f, p.background.xyz) - p.background.xyz);
    }
    const float total = run.count > 1 ? weigh_gradients(run, &sums) : weigh_only_slot(run, &sums);
    const float scale = 1.0f / total;
    background_weight = sums.background_weight * scale;
    global const ViewParams* view = views + (pixel + p.first_pixel) / p.pixels_per_view;
    const float depth_scale = view->inverse_range / p.gamma, inverse_alpha = 1.0f / p.alpha;
    const float background_depth = view->zfar - p.background_depth / view->inverse_range;
    const float depth_origin = slot_depth(run.slot[0], f, background_depth),
                log_origin = slot_log(run.slot[0], f);
    for (uint i = 0; i < run.count; ++i) {
      const Slot s = run.slot[i];
      const uint k = s.fragment;
      const int is_background = k == DPR_BACKGROUND_SLOT;
      const float grad_beta = scale * (is_background ? sums.background_beta : g.depth[k]);
      // d beta / d gamma = -(beta by depth) / gamma; d beta / d alpha = -ln p / alpha^2. Shifting all betas
      // changes nothing, so both count from the largest slot, where the gradients are: from elsewhere their
      // errors would be multiplied by the distance.
      grad_gamma += grad_beta * (slot_depth(s, f, background_depth) - depth_origin) * depth_scale / p.gamma;
      grad_alpha -= grad_beta * (slot_log(s, f) - log_origin) * inverse_alpha * inverse_alpha;
      if (is_background) continue;
      const float weight = scale * g.red[k];
      store_color(g, k, weight, grad);
      g.depth[k] = -grad_beta * depth_scale;
      g.log_occupancy[k] += grad_beta * inverse_alpha;
    }
  }
  write_channels(p, pixel, grad_gamma, grad_alpha, background_weight, grad, channels);
}

/// The first half of forward mode: derivatives of the pixel's colour by its fragments, and the image's tangents by
/// what the frame has one of. One work-item per pixel. Deterministic.
/// in   views, starts, list, fragments, slots, slot_counts  as aggregate_backward has them
/// in   frames  FrameTangent[direction]
/// out  rows    float[DPR_FRAGMENT_ROWS][fragment]  DPR_ROW_...
/// out  image_tangents  float4[direction][pixel]  from q.first on
kernel void aggregate_rows(const AggregateParams p, const TangentParams q,
                           global const ViewParams* restrict views, global const uint* restrict starts,
                           global const uint* restrict list, global const float* restrict fragments,
                           global Slot* restrict slots, global const uint* restrict slot_counts,
                           global const FrameTangent* restrict frames, global float* restrict rows,
                           global float4* restrict image_tangents) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= p.last_pixel) return;
  const uint first = starts[pixel], last = starts[pixel + 1], plane = p.grad_fragments;
  if (first == last) {
    store_frame_tangents(p, q, pixel, 1.0f, 0.0f, 0.0f, frames, image_tangents);
    return;
  }
  const Fragments f = make_fragments(p, list, fragments);
  const Slots run = {slots + first + pixel, slot_counts[pixel], 0.0f};
  const float transparency = run_transparency(f, first, last);
  for (uint i = first; i < last; ++i)
    clear_rows(list[i], plane, alpha_sensitivity(f, list[i], transparency), rows);
  SlotRows out = {rows, rows + DPR_ROW_DEPTH * plane, 0, plane, 0.0f, 0.0f};
  float total = 1.0f;
  if (run.count > 1) {
    total = weigh_rows(run, f, p.background.xyz, &out);
  } else {
    add_row(run.slot[0].fragment, 1.0f, 0.0f, &out);
  }
  const float scale = 1.0f / total;
  global const ViewParams* view = views + (pixel + p.first_pixel) / p.pixels_per_view;
  const float depth_scale = view->inverse_range / p.gamma, inverse_alpha = 1.0f / p.alpha;
  const float background_depth = view->zfar - p.background_depth / view->inverse_range;
  const float depth_origin = slot_depth(run.slot[0], f, background_depth),
              log_origin = slot_log(run.slot[0], f);
  float3 by_gamma = 0.0f, by_alpha = 0.0f;
  for (uint i = 0; i < run.count; ++i) {
    const Slot s = run.slot[i];
    const uint k = s.fragment;
    const int is_background = k == DPR_BACKGROUND_SLOT;
    const float3 by_beta = scale * (is_background ? out.background_beta : load_planes(k, plane, out.beta));
    // Shifting all betas changes nothing: they count from the largest, as in the backward pass.
    by_gamma += (slot_depth(s, f, background_depth) - depth_origin) * by_beta;
    by_alpha += (slot_log(s, f) - log_origin) * by_beta;
    if (is_background) continue;
    out.weight[k] *= scale;
    store_planes(-depth_scale * by_beta, k, plane, out.beta);
    store_planes(inverse_alpha * by_beta, k, plane, rows + DPR_ROW_LOG_OCCUPANCY * plane);
  }
  store_frame_tangents(p, q, pixel, scale * out.background_weight, depth_scale / p.gamma * by_gamma,
                       -inverse_alpha * inverse_alpha * by_alpha, frames, image_tangents);
}
