// Which samples contours reach: few of those near them do.
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
  const TileRow r = {(rows.view * p.height + row) * p.width + rows.first_column, rows.columns,
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

/// Whether a row's samples have others on all sides, as far as anything below looks.
static inline int is_inner_row(const FrameParams p, TileRow r) {
  return r.at.x >= 3 && r.at.x + DPR_TILE + 1 < p.width && r.at.y >= 3 && r.at.y + 2 < p.height;
}

/// A bit for each of a row's samples.
static inline uint bits_of(int8 is_set) {
  const int8 bit = is_set & (int8)(1, 2, 4, 8, 16, 32, 64, 128);
  const int4 half_bits = bit.lo | bit.hi;
  return (uint)(half_bits.x | half_bits.y | half_bits.z | half_bits.w);
}

/// What is at a step from an inner row's samples, or `away` samples further along it.
static inline uint8 steps_of_row(const FrameParams p, const Steps steps, TileRow r, int step, int away) {
  const int is_column = step & 1, samples = step < 2 ? away : -1 - away;
  return vload8(
      0, steps.winner + (is_column ? steps.pixels : 0) + r.first + samples * (is_column ? (int)p.width : 1));
}

/// Whether anything is at a step from a sample, or at the next `reach` - 1 in the same direction.
static inline int is_touched(const FrameParams p, const Steps steps, Sample s, int reach) {
  for (int k = 0; k < DPR_STEPS; ++k) {
    Sample at = s;
    for (int away = 0; away < reach; ++away) {
      if (at_step(p, steps, at, k) != DPR_NO_CROSSING) return 1;
      at = sample_beside(p, at, k);
    }
  }
  return 0;
}

/// Where is_touched() holds in a row of a tile. Most of the samples near a contour are not.
static inline uint touched_in_row(const FrameParams p, const Steps steps, TileRow r, int reach) {
  if (!is_inner_row(p, r)) {
    uint bits = 0;
    for (uint k = 0; k < r.count; ++k) bits |= is_touched(p, steps, sample_of(r, k), reach) ? 1u << k : 0u;
    return bits;
  }
  uint8 all = (uint8)(DPR_NO_CROSSING);
#pragma unroll
  for (int k = 0; k < DPR_STEPS; ++k) {
    for (int away = 0; away < reach; ++away) all &= steps_of_row(p, steps, r, k, away);
  }
  return bits_of(all != (uint8)(DPR_NO_CROSSING));
}

/// Whether a contour is at the step `away` samples ahead of a sample, and nothing before it.
static inline int is_ahead(const FrameParams p, const Steps steps, Sample s, int step, int away) {
  for (; away > 0; --away) {
    if (at_step(p, steps, s, step) != DPR_NO_CROSSING) return 0;
    s = sample_beside(p, s, step);
  }
  return is_contour(at_step(p, steps, s, step));
}

/// Where is_ahead() holds in a row of a tile.
static inline uint ahead_in_row(const FrameParams p, const Steps steps, TileRow r, int step, int away) {
  if (!is_inner_row(p, r)) {
    uint bits = 0;
    for (uint k = 0; k < r.count; ++k) bits |= is_ahead(p, steps, sample_of(r, k), step, away) ? 1u << k : 0u;
    return bits;
  }
  int8 is_set = steps_of_row(p, steps, r, step, away) < (uint8)(DPR_PASSED);
  for (int before = 0; before < away; ++before)
    is_set &= steps_of_row(p, steps, r, step, before) == (uint8)(DPR_NO_CROSSING);
  return bits_of(is_set);
}

#endif
