// Colours that a sample takes from beyond a contour.
#ifndef DPR_BLENDED_H
#define DPR_BLENDED_H

#include "touched.h"

/// Colours that a sample's parts at a step weigh: the difference of both with the sample's own continued all
/// the way, and the sum of their changes.
typedef struct {
  float4 difference, changes;
} Taken;

static inline Taken taken_at(const FrameParams p, const Steps steps, Sample s, int step,
                             global const float4* restrict raster) {
  const Sample other = sample_beside(p, s, step);
  const float4 change = change_towards(p, steps, s, step, raster);
  const Taken t = {raster[other.index] - raster[s.index] - change,
                   change_towards(p, steps, other, DPR_OPPOSITE(step), raster) + change};
  return t;
}

/// Colour that contours add to a sample, and all that it takes of the others, before that is brought to 1 at most.
typedef struct {
  float4 sum;
  float total;
} Addition;

/// One step after the other: unrolled, all four colours would be in registers at once.
static inline Addition addition_of(const FrameParams p, const Steps steps, Sample s,
                                   global const float4* raster) {
  Addition a = {(float4)(0.0f), 0.0f};
#pragma unroll 1
  for (int k = 0; k < DPR_STEPS; ++k) {
    if (!is_contour(at_step(p, steps, s, k))) continue;
    const Parts parts = parts_taken(cut_at(p, steps, s, k), turn_of(k));
    const Taken taken = taken_at(p, steps, s, k, raster);
    a.sum += parts.x * taken.difference + parts.y * taken.changes;
    a.total += parts.x;
  }
  return a;
}

#endif
