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

#endif
