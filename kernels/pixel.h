// A pixel's run of the fragment lists, what aggregation reads of a fragment, and the slots that the exact
// estimator makes of them.
#ifndef DPR_PIXEL_H
#define DPR_PIXEL_H

#include "lanes.h"
#include "shared_types.h"

/// 1 - p is kept above this, so that products without one factor are quotients.
#define DPR_MIN_TRANSPARENCY 1e-12f

/// The background's beta is kept within this: differences of betas are still numbers.
#define DPR_MAX_BETA 1e30f

/// Fragments by way of the pixels' lists.
typedef struct {
  global const uint* list;  // uint[...]        fragments, by pixel
  global const float *depth, *log_occupancy, *occupancy, *red, *green, *blue;  // float[fragment]
} Fragments;

static inline Fragments make_fragments(const AggregateParams p, global const uint* list,
                                       global const float* fragments) {
  Fragments f;
  f.list = list;
  f.depth = fragments + DPR_PLANE(p, DEPTH);
  f.log_occupancy = fragments + DPR_PLANE(p, LOG_OCCUPANCY);
  f.occupancy = fragments + DPR_PLANE(p, OCCUPANCY);
  f.red = fragments + DPR_PLANE(p, COLOR);
  f.green = f.red + p.fragments;
  f.blue = f.green + p.fragments;
  return f;
}

/// Their gradients.
typedef struct {
  global float *depth, *log_occupancy, *red, *green, *blue;  // float[fragment]
} FragmentGradients;

static inline FragmentGradients make_gradients(const AggregateParams p, global float* grads) {
  FragmentGradients g;
  g.depth = grads + DPR_GRAD_PLANE(p, DEPTH);
  g.log_occupancy = grads + DPR_GRAD_PLANE(p, LOG_OCCUPANCY);
  g.red = grads + DPR_GRAD_PLANE(p, COLOR);
  g.green = g.red + p.grad_fragments;
  g.blue = g.green + p.grad_fragments;
  return g;
}

/// Stores the gradient of a fragment's colour, which has that weight in its pixel.
static inline void store_color(const FragmentGradients to, uint fragment, float weight, float4 grad) {
  to.red[fragment] = weight * grad.x;
  to.green[fragment] = weight * grad.y;
  to.blue[fragment] = weight * grad.z;
}

static inline float3 fragment_color(const Fragments f, uint fragment) {
  return (float3)(f.red[fragment], f.green[fragment], f.blue[fragment]);
}

static inline float fragment_transparency(const Fragments f, uint fragment) {
  return max(1.0f - f.occupancy[fragment], DPR_MIN_TRANSPARENCY);
}

static inline float slot_transparency(const Slot s) { return max(1.0f - s.occupancy, DPR_MIN_TRANSPARENCY); }

/// prod (1 - p) over a run: what the pixel's alpha leaves.
static inline float run_transparency(const Fragments f, uint first, uint last) {
  float product = 1.0f;
  for (uint i = first; i < last; ++i) product *= fragment_transparency(f, f.list[i]);
  return product;
}

/// d alpha / d ln p of one fragment: p prod of the others' transparencies.
static inline float alpha_sensitivity(const Fragments f, uint fragment, float transparency) {
  return f.occupancy[fragment] * transparency / fragment_transparency(f, fragment);
}

/// Clears a fragment's rows, but for what its ln p adds to alpha.
static inline void clear_rows(uint fragment, uint plane, float coverage, global float* rows) {
  for (uint row = 0; row < DPR_ROW_COVERAGE; ++row) rows[fragment + row * plane] = 0.0f;
  rows[fragment + DPR_ROW_COVERAGE * plane] = coverage;
}

/// A pixel's tangents by what the frame has one of: background colour, gamma, alpha.
static inline void store_frame_tangents(const AggregateParams p, const TangentParams q, uint pixel,
                                        float background_weight, float3 by_gamma, float3 by_alpha,
                                        global const FrameTangent* frames, global float4* image_tangents) {
  for (uint d = 0; d < q.directions; ++d) {
    const FrameTangent t = frames[d];
    image_tangents[(size_t)(q.first + d) * p.pixels + pixel] = (float4)(
        background_weight * t.background.xyz + t.gamma * by_gamma + t.alpha * by_alpha, 0.0f);
  }
}

/// State shared by the slots of a pixel in the barrier composition.
typedef struct {
  uint first, last;   // the pixel's run of the fragment lists
  float nearest;      // view depth of the nearest fragment
  float depth_scale;  // d beta / d (nearest - depth)
  float inverse_alpha;
  float background;    // beta of the background slot
  float transparency;  // prod (1 - p)
} BarrierPixel;

/// Loads a pixel's run of `length`. Nothing is returned: oclgrind cannot read what a structure is returned
/// by where a call is always inlined.
DPR_ALWAYS_INLINE void load_barrier_run(const AggregateParams p, uint pixel, uint length,
                                        global const ViewParams* views, global const uint* starts,
                                        const Fragments f, BarrierPixel* out) {
  global const ViewParams* view = views + (pixel + p.first_pixel) / p.pixels_per_view;
  BarrierPixel q;
  q.first = starts[pixel];
  q.last = q.first + length;
  q.nearest = INFINITY;
  q.transparency = 1.0f;
  DPR_UNROLL_ON_CPU
  for (uint i = 0; i < length; ++i) {
    const uint k = f.list[q.first + i];
    q.nearest = f.depth[k] < q.nearest ? f.depth[k] : q.nearest;
    q.transparency *= fragment_transparency(f, k);
  }
  q.depth_scale = view->inverse_range / p.gamma;
  q.inverse_alpha = 1.0f / p.alpha;
  const float background = (p.background_depth - (view->zfar - q.nearest) * view->inverse_range) / p.gamma;
  q.background = clamp(background, -DPR_MAX_BETA, DPR_MAX_BETA);
  *out = q;
}

static inline BarrierPixel load_barrier_pixel(const AggregateParams p, uint pixel,
                                              global const ViewParams* restrict views,
                                              global const uint* restrict starts, const Fragments f) {
  BarrierPixel q;
  load_barrier_run(p, pixel, starts[pixel + 1] - starts[pixel], views, starts, f, &q);
  return q;
}

/// b / gamma, eq. (7): relative to the pixel's nearest fragment, since zeta / gamma itself would waste its
/// bits.
static inline float barrier_beta(const BarrierPixel q, float depth, float log_occupancy) {
  return (q.nearest - depth) * q.depth_scale + log_occupancy * q.inverse_alpha;
}

/// Slots whose integral is to be evaluated: all of a pixel that count, or a cluster.
typedef struct {
  global Slot* slot;
  uint count;
  float covering;  // joint: the sum of their occupancies
} Slots;

/// As vectors: a structure on its way would be put into a GPU's scratch memory.
static inline void swap_slots(global Slot* a, global Slot* b) {
  const uint4 moved = vload4(0, (global uint*)a);
  vstore4(vload4(0, (global uint*)b), 0, (global uint*)a);
  vstore4(moved, 0, (global uint*)b);
}

/// A pixel's share of the gradients of gamma, alpha and the background colour, which had that weight in it;
/// where there are channels.
static inline void write_channels(const AggregateParams p, uint pixel, float grad_gamma, float grad_alpha,
                                  float background_weight, float4 grad, global float* channels) {
  if (p.channels == 0) return;
  channels[DPR_CHANNEL_BACKGROUND * p.pixels + pixel] = background_weight * grad.x;
  channels[(DPR_CHANNEL_BACKGROUND + 1) * p.pixels + pixel] = background_weight * grad.y;
  channels[(DPR_CHANNEL_BACKGROUND + 2) * p.pixels + pixel] = background_weight * grad.z;
  channels[DPR_CHANNEL_GAMMA * p.pixels + pixel] = grad_gamma;
  if (p.channels > DPR_CHANNEL_ALPHA) channels[DPR_CHANNEL_ALPHA * p.pixels + pixel] = grad_alpha;
}

#endif
