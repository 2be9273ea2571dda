// Share of a sample beside contours that fades (antialias_fade.cl), and the colour that takes its place.
#ifndef DPR_FADED_H
#define DPR_FADED_H

#include "touched.h"

/// Nearness of a contour at a step: 1 on the sample, 0 on the step's other end.
static inline float nearness(Cut cut, float turn) { return clamp(0.5f + turn * cut.x, 0.0f, 1.0f); }

/// Part of a sample's colour that the colour from behind replaces. The third power leaves the
/// image most of what is seen, and still bounds the gradients of colours that grow with the root of the
/// distance to a silhouette.
static inline float share_faded(Cut cut, float turn) {
  const float near = nearness(cut, turn);
  return weight_of_slope(cut.y) * near * near * near;
}

/// Derivative of share_faded() with respect to the cut.
static inline Cut share_faded_gradient(Cut cut, float turn) {
  const float near = nearness(cut, turn), near2 = near * near;
  return (Cut)(near < 1.0f ? 3.0f * turn * weight_of_slope(cut.y) * near2 : 0.0f,
               weight_of_slope_gradient(cut.y) * near2 * near);
}

/// Steps that fade a sample: at most one of either axis, since a colour continues from the other side.
typedef struct {
  int2 step;     // by axis; -1: none
  float2 share;  // 0 where nothing does; together at most 1
  float limit;   // what that has scaled them by
} Fading;

/// The same as it is kept: the share by each axis, negative for the step to the left or up.
typedef float2 Shares;

/// Step of an axis whose contour fades a sample; -1 if there is none.
static inline int step_that_fades(const FrameParams p, const Steps steps, Sample s, int axis) {
  const uint ahead = at_step(p, steps, s, axis), back = at_step(p, steps, s, DPR_OPPOSITE(axis));
  if (is_contour(ahead) && back == DPR_NO_CROSSING)
    return is_on_raster(p, sample_beside(p, s, DPR_OPPOSITE(axis))) ? axis : -1;
  if (is_contour(back) && ahead == DPR_NO_CROSSING)
    return is_on_raster(p, sample_beside(p, s, axis)) ? DPR_OPPOSITE(axis) : -1;
  return -1;
}

static inline float share_at(const FrameParams p, const Steps steps, Sample s, int step) {
  return step < 0 ? 0.0f : share_faded(cut_at(p, steps, s, step), turn_of(step));
}

static inline Fading fading_of(const FrameParams p, const Steps steps, Sample s) {
  Fading f;
  f.step = (int2)(step_that_fades(p, steps, s, 0), step_that_fades(p, steps, s, 1));
  f.share = (float2)(share_at(p, steps, s, f.step.x), share_at(p, steps, s, f.step.y));
  f.limit = 1.0f / fmax(f.share.x + f.share.y, 1.0f);
  f.share *= f.limit;
  return f;
}

static inline Shares shares_of(const Fading f) {
  return (Shares)(f.step.x < 2 ? f.share.x : -f.share.x, f.step.y < 2 ? f.share.y : -f.share.y);
}

/// The share of a step; 0 where it does not fade the sample.
static inline float share_of(Shares shares, int step) {
  const float of_axis = step & 1 ? shares.y : shares.x;
  return fmax(step < 2 ? of_axis : -of_axis, 0.0f);
}

/// The colour that continues to a sample along a step from the two samples behind it, or from one.
static inline float4 continued_to(const FrameParams p, const Steps steps, Sample s, int step,
                                  global const float4* restrict raster) {
  const Sample behind = sample_beside(p, s, DPR_OPPOSITE(step));
  return raster[behind.index] + change_towards(p, steps, behind, step, raster);
}

static inline float4 faded(const FrameParams p, const Steps steps, Sample s, const Fading f,
                           global const float4* restrict raster) {
  float4 sum = (1.0f - f.share.x - f.share.y) * raster[s.index];
  if (f.step.x >= 0) sum += f.share.x * continued_to(p, steps, s, f.step.x, raster);
  if (f.step.y >= 0) sum += f.share.y * continued_to(p, steps, s, f.step.y, raster);
  return sum;
}

#endif
