// Samples beside contours, faded. A sample appears and disappears where a contour passes over it. If its
// colour counted in full until then, the image would jump by what it differs from its neighbours': a lot at
// smooth silhouettes, where colours change ever faster, and most where a face that is seen nearly edge-on has
// one sample. Gradients do not see jumps, so that they would be off by their mean. So the nearer a contour is
// to a sample, the less the sample's own colour counts, and the more what continues to it from those behind.
#include "touched.h"

/// How near a contour at a step is: 1 on the sample, 0 on the step's other end.
static inline float nearness(Cut cut, float turn) { return clamp(0.5f + turn * cut.x, 0.0f, 1.0f); }

/// How much of a sample's colour is replaced with what continues from behind. The third power leaves the
/// image most of what is seen, and still bounds the gradients of colours that grow with the root of the
/// distance to a silhouette.
static inline float share_faded(Cut cut, float turn) {
  const float near = nearness(cut, turn);
  return weight_of_slope(cut.y) * near * near * near;
}

/// Its gradient by the cut.
static inline Cut share_faded_gradient(Cut cut, float turn) {
  const float near = nearness(cut, turn), near2 = near * near;
  return (Cut)(near < 1.0f ? 3.0f * turn * weight_of_slope(cut.y) * near2 : 0.0f,
               weight_of_slope_gradient(cut.y) * near2 * near);
}

/// Whether a contour at a step fades a sample: there is something behind that continues to it.
static inline int is_faded_at(const FrameParams p, const Steps steps, Sample s, int step) {
  return is_contour(at_step(p, steps, s, step)) && continues(p, steps, s, step);
}

static inline float share_at(const FrameParams p, const Steps steps, Sample s, int step) {
  return share_faded(steps.cut[place_of(p, steps, s, step)], turn_of(step));
}

/// The sum of the shares at all steps, or 1 if that is less.
static inline float total_faded(const FrameParams p, const Steps steps, Sample s) {
  float sum = 0.0f;
#pragma unroll
  for (int k = 0; k < DPR_STEPS; ++k) {
    if (is_faded_at(p, steps, s, k)) sum += share_at(p, steps, s, k);
  }
  return fmax(sum, 1.0f);
}

/// The colour that continues to a sample along a step from the two samples behind it, or from one.
static inline float4 continued_to(const FrameParams p, const Steps steps, Sample s, int step,
                                  global const float4* restrict raster) {
  const Sample behind = sample_beside(p, s, DPR_OPPOSITE(step));
  return raster[behind.index] + change_towards(p, steps, behind, step, raster);
}

static inline float4 faded(const FrameParams p, const Steps steps, Sample s,
                           global const float4* restrict raster) {
  float4 sum = 0.0f;
#pragma unroll 1
  for (int k = 0; k < DPR_STEPS; ++k) {
    if (is_faded_at(p, steps, s, k))
      sum += share_at(p, steps, s, k) * (continued_to(p, steps, s, k, raster) - raster[s.index]);
  }
  return raster[s.index] + sum / total_faded(p, steps, s);
}

/// Fades the samples near contours, and keeps them as they were. One work-item per DPR_ROWS of a tile.
/// Deterministic.
/// in   tile_starts  uint[view * tile + 1]  runs of contours' pairs
/// in   winner, cut  as antialias_cross leaves them
/// in   raster       float4[pixel]          the samples
/// out  kept         float4[pixel]          not written in tiles further than one from a contour
/// out  faded_raster float4[pixel]          the same
kernel void antialias_fade(const FrameParams p, global const uint* restrict tile_starts,
                           global const uint* restrict winner, global const float2* restrict cut,
                           global const float4* restrict raster, global float4* restrict kept,
                           global float4* restrict faded_raster) {
  const TileRows rows = tile_rows(p, (uint)get_global_id(0));
  if (rows.first >= rows.last || !is_near_contour(p, rows.tile, 1, tile_starts)) return;
  const Steps steps = {winner, cut, p.views * p.width * p.height};
  for (uint row = rows.first; row < rows.last; ++row) {
    const TileRow r = row_of(p, rows, row);
    copy_row(r, raster, kept);
    copy_row(r, raster, faded_raster);
    for (uint touched = touched_in_row(p, steps, r, 1); touched != 0; touched &= touched - 1) {
      const Sample s = sample_of(r, lowest_bit(touched));
      faded_raster[s.index] = faded(p, steps, s, raster);
    }
  }
}

/// What the gradient of a faded sample is to its cut at a step.
static inline Cut gradient_at_end(const FrameParams p, const Steps steps, Sample s, int step,
                                  global const float4* restrict raster, global const float4* restrict grad) {
  if (!is_faded_at(p, steps, s, step)) return 0.0f;
  const float total = total_faded(p, steps, s);
  const float4 own = total > 1.0f ? faded(p, steps, s, raster) : raster[s.index];
  return dot(grad[s.index], continued_to(p, steps, s, step, raster) - own) / total *
         share_faded_gradient(steps.cut[place_of(p, steps, s, step)], turn_of(step));
}

/// The part of a faded sample's gradient that what continues along a step has; 0 where that is nothing.
static inline float4 gradient_continued(const FrameParams p, const Steps steps, Sample s, int step,
                                        global const float4* restrict grad) {
  if (!is_faded_at(p, steps, s, step)) return 0.0f;
  return share_at(p, steps, s, step) / total_faded(p, steps, s) * grad[s.index];
}

/// What a sample is to those that it continues to along a step: the next, and the one after that.
static inline float4 gradient_ahead(const FrameParams p, const Steps steps, Sample s, int step,
                                    global const float4* restrict grad) {
  if (at_step(p, steps, s, step) != DPR_NO_CROSSING) return 0.0f;
  const Sample next = sample_beside(p, s, step);
  if (!is_on_raster(p, next)) return 0.0f;
  if (at_step(p, steps, next, step) == DPR_NO_CROSSING) {
    const Sample second = sample_beside(p, next, step);
    return is_on_raster(p, second) ? -gradient_continued(p, steps, second, step, grad) : 0.0f;
  }
  return (continues(p, steps, s, step) ? 2.0f : 1.0f) * gradient_continued(p, steps, next, step, grad);
}

/// The gradients of the samples by those of the faded ones, and of the cuts. One work-item per DPR_ROWS of a
/// tile; a step's cut is its first sample's to write. Deterministic.
/// Inputs as antialias_fade, and
/// in      grad_faded  float4[pixel]   kept as the samples are
/// in out  grad_cut    Cut[2][pixel]
/// in out  grad_raster float4[pixel]   the gradients of the faded samples
kernel void antialias_fade_backward(const FrameParams p, global const uint* restrict tile_starts,
                                    global const uint* restrict winner, global const float2* restrict cut,
                                    global const float4* restrict raster,
                                    global const float4* restrict grad_faded,
                                    global float2* restrict grad_cut, global float4* restrict grad_raster) {
  const TileRows rows = tile_rows(p, (uint)get_global_id(0));
  if (rows.first >= rows.last || !is_near_contour(p, rows.tile, 1, tile_starts)) return;
  const Steps steps = {winner, cut, p.views * p.width * p.height};
  for (uint row = rows.first; row < rows.last; ++row) {
    const TileRow r = row_of(p, rows, row);
    for (uint touched = touched_in_row(p, steps, r, 3); touched != 0; touched &= touched - 1) {
      const Sample s = sample_of(r, lowest_bit(touched));
      float4 grad = grad_faded[s.index];
      for (int k = 0; k < DPR_STEPS; ++k) {
        grad += gradient_ahead(p, steps, s, k, grad_faded) - gradient_continued(p, steps, s, k, grad_faded);
        if (k >= 2 || !is_contour(at_step(p, steps, s, k))) continue;
        const Sample other = sample_beside(p, s, k);
        grad_cut[place_of(p, steps, s, k)] +=
            gradient_at_end(p, steps, s, k, raster, grad_faded) +
            gradient_at_end(p, steps, other, DPR_OPPOSITE(k), raster, grad_faded);
      }
      grad_raster[s.index] = grad;
    }
  }
}
