// Samples blended across the contours between them. Where a contour crosses the step between two neighbouring
// samples, each takes a part of what the other's colour is beyond it (steps.h): the image follows the
// contour, and its derivative by what is cut is the jump across it. What crosses, and how much it cuts,
// antialias_cross.cl finds.
//
// Few steps are crossed: samples are blended where they lie, by those near contours as antialias_fade.cl has
// faded and kept them. A work-item takes a row of a tile, or on a CPU, whose lanes are a row's samples, all
// of its rows.
#include "blended.h"

/// Keeps the gradients of the samples near contours, which the passes that follow change where they lie. One
/// work-item per DPR_ROWS of a tile. Deterministic.
///
/// in   tile_starts  uint[view * tile + 1]  runs of contours' pairs
/// in   from         float4[pixel]
/// out  kept         float4[pixel]          not written in tiles further than one from a contour
kernel void antialias_keep(const FrameParams p, global const uint* restrict tile_starts,
                           global const float4* restrict from, global float4* restrict kept) {
  const TileRows rows = tile_rows(p, (uint)get_global_id(0));
  if (rows.first >= rows.last || !is_near_contour(p, rows.tile, 1, tile_starts)) return;
  for (uint row = rows.first; row < rows.last; ++row) copy_row(row_of(p, rows, row), from, kept);
}

/// Colour that contours add to a sample.
static inline float4 added_to(const FrameParams p, const Steps steps, Sample s,
                              global const float4* restrict raster) {
  const Addition all = addition_of(p, steps, s, raster);
  return all.sum / fmax(all.total, 1.0f);
}

/// Blends the samples. One work-item per DPR_ROWS of a tile. Deterministic.
/// in      tile_starts  as antialias_keep has it
/// in      winner, cut  as antialias_cross leaves them
/// in      raster       float4[pixel]  the samples, as antialias_fade has faded them
/// in out  blended      float4[pixel]  the samples
kernel void antialias_forward(const FrameParams p, global const uint* restrict tile_starts,
                              global const uint* restrict winner, global const float2* restrict cut,
                              global const float4* restrict raster, global float4* restrict blended) {
  const TileRows rows = tile_rows(p, (uint)get_global_id(0));
  if (rows.first >= rows.last || !may_be_crossed(p, rows.tile, tile_starts)) return;
  const Steps steps = {winner, cut, samples_of_window(p)};
  for (uint row = rows.first; row < rows.last; ++row) {
    const TileRow r = row_of(p, rows, row);
    for (uint touched = touched_in_row(p, steps, r, 1); touched != 0; touched &= touched - 1) {
      const Sample s = sample_of(r, lowest_bit(touched));
      blended[s.index] = raster[s.index] + added_to(p, steps, s, raster);
    }
  }
}

/// Gradient of a step's cut from the sample at the step's end. Where the parts are scaled by their `total`,
/// so is the change by one of them.
static inline Cut gradient_at_end(const FrameParams p, const Steps steps, Sample s, int step, float total,
                                  global const float4* restrict raster, float4 grad) {
  const Taken taken = taken_at(p, steps, s, step, raster);
  const float4 added = total > 1.0f ? added_to(p, steps, s, raster) : 0.0f;
  const Parts grad_parts = (Parts)(dot(grad, taken.difference - added), dot(grad, taken.changes)) / total;
  return parts_taken_gradient(cut_at(p, steps, s, step), turn_of(step), grad_parts);
}

/// The parts that a sample takes at a step that is crossed.
static inline Parts share_taken(const FrameParams p, const Steps steps, Sample s, int step, float total) {
  return parts_taken(cut_at(p, steps, s, step), turn_of(step)) / total;
}

/// Gradient that a sample receives from the samples at a crossed step from it, itself among them, and from
/// those at the next step, behind whose first it lies.
static inline float4 gradient_through(const FrameParams p, const Steps steps, Sample s, int step, float total,
                                      global const float4* restrict grad) {
  const int back = DPR_OPPOSITE(step);
  const uint here = at_step(p, steps, s, step);
  const Sample other = sample_beside(p, s, step);
  if (is_contour(here)) {
    const Parts own = share_taken(p, steps, s, step, total),
                others = share_taken(p, steps, other, back, total_taken(p, steps, other));
    const float is_continued = continues(p, steps, s, step) ? 1.0f : 0.0f;
    return (others.x + is_continued * others.y) * grad[other.index] -
           (own.x + is_continued * (own.x - own.y)) * grad[s.index];
  }
  if (here != DPR_NO_CROSSING || !is_contour(at_step(p, steps, other, step))) return 0.0f;
  const Sample beyond = sample_beside(p, other, step);
  const Parts first = share_taken(p, steps, other, step, total_taken(p, steps, other)),
              second = share_taken(p, steps, beyond, back, total_taken(p, steps, beyond));
  return (first.x - first.y) * grad[other.index] - second.y * grad[beyond.index];
}

/// Adds to a sample's gradient what it has given to others, less what others have of its colour. Writes the
/// gradients of the cuts of its steps to the right and down.
static inline void differentiate_sample(const FrameParams p, const Steps steps, Sample s,
                                        global const float4* restrict raster,
                                        global const float4* restrict grad_blended,
                                        global float2* restrict grad_cut,
                                        global float4* restrict grad_raster) {
  const float total = total_taken(p, steps, s);
  for (int k = 0; k < DPR_STEPS; ++k) {
    grad_raster[s.index] += gradient_through(p, steps, s, k, total, grad_blended);
    if (k >= 2 || !is_contour(at_step(p, steps, s, k))) continue;
    const Sample other = sample_beside(p, s, k);
    grad_cut[place_of(p, steps, s, k)] =
        gradient_at_end(p, steps, s, k, total, raster, grad_blended[s.index]) +
        gradient_at_end(p, steps, other, DPR_OPPOSITE(k), total_taken(p, steps, other), raster,
                        grad_blended[other.index]);
  }
}

/// The gradients of the cuts, and those of the samples: what each has kept of its own colour, and given to
/// others. One work-item per DPR_ROWS of a tile; a step's cut is its first sample's to write. Deterministic.
/// Inputs as antialias_forward, and
/// in      grad_blended  float4[pixel]  kept as the samples are
/// out     grad_cut      Cut[2][pixel]  not written where nothing crosses
/// in out  grad_raster   float4[pixel]  the gradients of the blended samples
kernel void antialias_backward(const FrameParams p, global const uint* restrict tile_starts,
                               global const uint* restrict winner, global const float2* restrict cut,
                               global const float4* restrict raster,
                               global const float4* restrict grad_blended, global float2* restrict grad_cut,
                               global float4* restrict grad_raster) {
  const TileRows rows = tile_rows(p, (uint)get_global_id(0));
  if (rows.first >= rows.last || !is_near_contour(p, rows.tile, 1, tile_starts)) return;
  const Steps steps = {winner, cut, samples_of_window(p)};
  for (uint row = rows.first; row < rows.last; ++row) {
    const TileRow r = row_of(p, rows, row);
    for (uint touched = touched_in_row(p, steps, r, 2); touched != 0; touched &= touched - 1)
      differentiate_sample(p, steps, sample_of(r, lowest_bit(touched)), raster, grad_blended, grad_cut,
                           grad_raster);
  }
}
