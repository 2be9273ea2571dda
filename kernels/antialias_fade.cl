// Samples beside contours, faded. A sample appears and disappears where a contour passes over it. If its
// colour counted in full until then, the image would jump by what it differs from its neighbours': a lot at
// smooth silhouettes, where colours change ever faster, and most where a face that is seen nearly edge-on has
// one sample. Gradients do not see jumps, so that they would be off by their mean. So the nearer a contour is
// to a sample, the less the sample's own colour counts, and the more what continues to it from those behind.
#include "faded.h"

/// Fades the samples near contours, and keeps them as they were. One work-item per DPR_ROWS of a tile.
/// Deterministic.
/// in   tile_starts  uint[view * tile + 1]  runs of contours' pairs
/// in   winner, cut  as antialias_cross leaves them
/// in   raster       float4[pixel]          the samples
/// out  kept         float4[pixel]          not written in tiles further than one from a contour
/// out  faded_raster float4[pixel]          the same
/// out  shares       Shares[pixel]          not written away from contours
kernel void antialias_fade(const FrameParams p, global const uint* restrict tile_starts,
                           global const uint* restrict winner, global const float2* restrict cut,
                           global const float4* restrict raster, global float4* restrict kept,
                           global float4* restrict faded_raster, global float2* restrict shares) {
  const TileRows rows = tile_rows(p, (uint)get_global_id(0));
  if (rows.first >= rows.last || !is_near_contour(p, rows.tile, 1, tile_starts)) return;
  const Steps steps = {winner, cut, samples_of_window(p)};
  for (uint row = rows.first; row < rows.last; ++row) {
    const TileRow r = row_of(p, rows, row);
    if (touched_in_row(p, steps, r, 3) == 0) continue;
    copy_row(r, raster, kept);
    copy_row(r, raster, faded_raster);
    for (uint touched = touched_in_row(p, steps, r, 1); touched != 0; touched &= touched - 1) {
      const Sample s = sample_of(r, lowest_bit(touched));
      const Fading f = fading_of(p, steps, s);
      faded_raster[s.index] = faded(p, steps, s, f, raster);
      shares[s.index] = shares_of(f);
    }
  }
}

/// Gradient of a faded sample with respect to its cut at a step.
static inline Cut faded_gradient_at_end(const FrameParams p, const Steps steps, Sample s, int step,
                                        global const float4* restrict raster,
                                        global const float4* restrict grad) {
  const Fading f = fading_of(p, steps, s);
  if ((step & 1 ? f.step.y : f.step.x) != step) return 0.0f;
  const float4 own = f.limit < 1.0f ? faded(p, steps, s, f, raster) : raster[s.index];
  return f.limit * dot(grad[s.index], continued_to(p, steps, s, step, raster) - own) *
         share_faded_gradient(cut_at(p, steps, s, step), turn_of(step));
}

/// Gradient that a sample receives from the next two samples along a step, which extrapolate from it.
static inline float4 gradient_ahead(const FrameParams p, const Steps steps, Sample s, int step,
                                    global const float2* restrict shares,
                                    global const float4* restrict grad) {
  const Sample next = sample_beside(p, s, step), second = sample_beside(p, next, step);
  const uint beyond = at_step(p, steps, next, step);
  if (is_contour(beyond)) {
    const float counted = continues(p, steps, s, step) ? 2.0f : 1.0f;
    return counted * share_of(shares[next.index], step) * grad[next.index];
  }
  return beyond == DPR_NO_CROSSING && is_contour(at_step(p, steps, second, step))
             ? -share_of(shares[second.index], step) * grad[second.index]
             : 0.0f;
}

/// Gives a sample the gradients of the faded ones that it is part of, and the cuts of its steps to the right
/// and down theirs.
static inline void differentiate_faded(const FrameParams p, const Steps steps, Sample s,
                                       global const float4* restrict raster,
                                       global const float2* restrict shares,
                                       global const float4* restrict grad_faded,
                                       global float2* restrict grad_cut,
                                       global float4* restrict grad_raster) {
  float4 grad = grad_faded[s.index];
#pragma unroll 1
  for (int k = 0; k < DPR_STEPS; ++k) {
    const uint at = at_step(p, steps, s, k);
    if (at == DPR_NO_CROSSING) grad += gradient_ahead(p, steps, s, k, shares, grad_faded);
    if (!is_contour(at)) continue;
    grad -= share_of(shares[s.index], k) * grad_faded[s.index];
    if (k >= 2) continue;
    const Sample other = sample_beside(p, s, k);
    grad_cut[place_of(p, steps, s, k)] +=
        faded_gradient_at_end(p, steps, s, k, raster, grad_faded) +
        faded_gradient_at_end(p, steps, other, DPR_OPPOSITE(k), raster, grad_faded);
  }
  grad_raster[s.index] = grad;
}

/// The gradients of the samples by those of the faded ones, and of the cuts. One work-item per DPR_ROWS of a
/// tile; a step's cut is its first sample's to write. Deterministic.
/// Inputs as antialias_fade, and
/// in      shares      Shares[pixel]   as it leaves them
/// in      grad_faded  float4[pixel]   kept as the samples are
/// in out  grad_cut    Cut[2][pixel]
/// in out  grad_raster float4[pixel]   the gradients of the faded samples
kernel void antialias_fade_backward(const FrameParams p, global const uint* restrict tile_starts,
                                    global const uint* restrict winner, global const float2* restrict cut,
                                    global const float4* restrict raster,
                                    global const float2* restrict shares,
                                    global const float4* restrict grad_faded,
                                    global float2* restrict grad_cut, global float4* restrict grad_raster) {
  const TileRows rows = tile_rows(p, (uint)get_global_id(0));
  if (rows.first >= rows.last || !is_near_contour(p, rows.tile, 1, tile_starts)) return;
  const Steps steps = {winner, cut, samples_of_window(p)};
  for (uint row = rows.first; row < rows.last; ++row) {
    const TileRow r = row_of(p, rows, row);
    for (uint touched = touched_in_row(p, steps, r, 3); touched != 0; touched &= touched - 1)
      differentiate_faded(p, steps, sample_of(r, lowest_bit(touched)), raster, shares, grad_faded, grad_cut,
                          grad_raster);
  }
}
