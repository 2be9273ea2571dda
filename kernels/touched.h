// Samples that contours touch: few of those near contours.
#ifndef DPR_TOUCHED_H
#define DPR_TOUCHED_H

#include "steps.h"
#include "tile_rows.h"

/// A row of a tile: `count` samples from `first` on, at column and row `at` of its view.
typedef struct {
  uint first, count;
  uint2 at;
} TileRow;

static inline TileRow row_of(const FrameParams p, const TileRows rows, uint row) {
  const TileRow r = {place_of_sample(p, rows.view, rows.first_column, row), rows.columns,
                     (uint2)(rows.first_column, row)};
  return r;
}

static inline Sample sample_of(TileRow r, uint k) {
  const Sample s = {r.first + k, (int2)((int)(r.at.x + k), (int)r.at.y)};
  return s;
}

static inline void copy_row(TileRow r, global const float4* restrict from, global float4* restrict to) {
  if (r.count == DPR_TILE) {
    global const float* first = (global const float*)(from + r.first);
    const float16 low = vload16(0, first), high = vload16(1, first);
    vstore16(low, 0, (global float*)(to + r.first));
    vstore16(high, 1, (global float*)(to + r.first));
    return;
  }
  for (uint k = 0; k < r.count; ++k) to[r.first + k] = from[r.first + k];
}

/// True if anything is at a step from a sample, or at the next `reach` - 1 in the same direction.
static inline int is_touched(const FrameParams p, const Steps steps, Sample s, int reach) {
  uint all = DPR_NO_CROSSING;
#pragma unroll
  for (int k = 0; k < DPR_STEPS; ++k) {
    all &= at_step(p, steps, s, k);
    if (reach >= 2) all &= at_step(p, steps, sample_beside(p, s, k), k);
    if (reach >= 3) all &= at_step(p, steps, sample_beside(p, sample_beside(p, s, k), k), k);
  }
  return all != DPR_NO_CROSSING;
}

/// is_touched() of a row of a tile: a bit a sample. Most of the samples near a contour are not.
static inline uint touched_in_row(const FrameParams p, const Steps steps, TileRow r, int reach) {
  const int is_inner = r.at.x >= 3 && r.at.x + DPR_TILE + 1 < p.width && r.at.y >= 3 && r.at.y + 2 < p.height;
  uint bits = 0;
  if (!is_inner) {
    for (uint k = 0; k < r.count; ++k) bits |= is_touched(p, steps, sample_of(r, k), reach) ? 1u << k : 0u;
    return bits;
  }
  global const uint *right = steps.winner + r.first, *down = right + steps.pixels;
  uint8 all = vload8(0, right) & vload8(0, right - 1) & vload8(0, down) & vload8(0, down - p.width);
  if (reach >= 2) {
    all &= vload8(0, right + 1) & vload8(0, right - 2) & vload8(0, down + p.width) &
           vload8(0, down - 2 * p.width);
  }
  if (reach >= 3) {
    all &= vload8(0, right + 2) & vload8(0, right - 3) & vload8(0, down + 2 * p.width) &
           vload8(0, down - 3 * p.width);
  }
  const int8 is_clear = all == (uint8)(DPR_NO_CROSSING);
  const int8 bit = ~is_clear & (int8)(1, 2, 4, 8, 16, 32, 64, 128);
  const int4 half_bits = bit.lo | bit.hi;
  return (uint)(half_bits.x | half_bits.y | half_bits.z | half_bits.w);
}

#endif
