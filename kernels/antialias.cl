// Samples blended across the contours between them. Where a contour crosses the step between two neighbouring
// samples, each takes a part of the other's colour (crossing.h): the image follows the contour, and its
// derivative by what is cut is the jump across it. What crosses, and how much it cuts, antialias_cross.cl
// finds.
//
// Few steps are crossed: a work-item takes a row of a tile, and copies it where no contour is near.
#include "crossing.h"

/// The steps from a sample: to the right, down, from the left, from above; and the same step as the sample at
/// its other end counts it.
#define DPR_STEPS 4
#define DPR_OPPOSITE(step) ((step) ^ 2)

/// Which end of a step a sample is: see part_taken().
static inline float turn_of(int step) { return step < 2 ? -1.0f : 1.0f; }

typedef struct {
  uint step[DPR_STEPS], other[DPR_STEPS];  // the step, and the sample at its other end
  int is_crossed[DPR_STEPS];
  Cut cut[DPR_STEPS];     // of those that are
  float part[DPR_STEPS];  // that is taken of the other sample's colour
  float total;            // of the parts, or 1 if that is less
} Cell;

/// Whether anything crosses a step from a sample, in column and row `at` of its view.
static inline int is_crossed(const FrameParams p, uint pixel, uint2 at, uint pixels,
                             global const uint* restrict winner) {
  const uint left = at.x > 0 ? winner[pixel - 1] : DPR_NO_CROSSING;
  const uint above = at.y > 0 ? winner[pixels + pixel - p.width] : DPR_NO_CROSSING;
  return (winner[pixel] & winner[pixels + pixel] & left & above) != DPR_NO_CROSSING;
}

static inline Cell load_cell(const FrameParams p, uint pixel, uint2 at, uint pixels,
                             global const uint* restrict winner, global const float2* restrict cut) {
  const int has[DPR_STEPS] = {1, 1, at.x > 0, at.y > 0};
  const uint first[DPR_STEPS] = {pixel, pixels + pixel, pixel - 1, pixels + pixel - p.width};
  const uint other[DPR_STEPS] = {pixel + 1, pixel + p.width, pixel - 1, pixel - p.width};
  Cell c;
  float sum = 0.0f;
#pragma unroll
  for (int k = 0; k < DPR_STEPS; ++k) {
    c.step[k] = first[k];
    c.other[k] = other[k];
    c.is_crossed[k] = has[k] && winner[first[k]] != DPR_NO_CROSSING;
    c.cut[k] = c.is_crossed[k] ? cut[first[k]] : (Cut)(0.0f);
    c.part[k] = part_taken(c.cut[k], turn_of(k));
    sum += c.part[k];
  }
  c.total = fmax(sum, 1.0f);
  return c;
}

/// A row of a tile: `count` samples from `first` on, at column and row `at` of its view; none below the
/// raster.
typedef struct {
  uint tile, first, count;
  uint2 at;
} TileRow;

static inline TileRow tile_row(const FrameParams p, uint i) {
  TileRow r;
  r.tile = i / DPR_TILE;
  const TileSamples s = tile_samples(p, r.tile);
  const uint view = r.tile / (p.tiles_x * p.tiles_y);
  r.at = (uint2)((uint)s.first_column, (uint)s.first_row + i % DPR_TILE);
  r.first = (view * p.height + r.at.y) * p.width + r.at.x;
  r.count = view < p.views && r.at.y < p.height ? (uint)(s.last_column - s.first_column) : 0;
  return r;
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

/// What becomes of a sample's colour `own`.
static inline float4 mixed_cell(const Cell c, float4 own, global const float4* restrict raster) {
  float4 sum = own;
#pragma unroll
  for (int k = 0; k < DPR_STEPS; ++k) {
    if (c.is_crossed[k]) sum += c.part[k] / c.total * (raster[c.other[k]] - own);
  }
  return sum;
}

/// Blends the samples. Contours on all sides of a sample may leave nothing of it: then the others share it.
/// One work-item per row of a tile. Deterministic.
/// in   tile_starts  uint[view * tile + 1]  runs of contours' pairs
/// in   winner, cut  as antialias_cross leaves them
/// in   raster       float4[pixel]  the samples
/// out  blended      float4[pixel]
kernel void antialias_forward(const FrameParams p, global const uint* restrict tile_starts,
                              global const uint* restrict winner, global const float2* restrict cut,
                              global const float4* restrict raster, global float4* restrict blended) {
  const TileRow r = tile_row(p, (uint)get_global_id(0));
  if (r.count == 0) return;
  if (!may_be_crossed(p, r.tile, tile_starts)) {
    copy_row(r, raster, blended);
    return;
  }
  const uint pixels = p.views * p.width * p.height;
  for (uint k = 0; k < r.count; ++k) {
    const uint pixel = r.first + k;
    const uint2 at = r.at + (uint2)(k, 0u);
    blended[pixel] = is_crossed(p, pixel, at, pixels, winner)
                         ? mixed_cell(load_cell(p, pixel, at, pixels, winner, cut), raster[pixel], raster)
                         : raster[pixel];
  }
}

/// What the end of step k of a sample gives the step's cut. Where the parts are scaled to add up to 1, so is
/// what one of them changes.
static inline Cut gradient_at_end(const Cell c, int k, uint pixel, global const float4* restrict raster,
                                  float4 grad) {
  const float4 own = raster[pixel], from = c.total > 1.0f ? mixed_cell(c, own, raster) : own;
  return dot(grad, raster[c.other[k]] - from) / c.total * part_taken_gradient(c.cut[k], turn_of(k));
}

/// The gradients of the cuts, and those of the samples: what each has kept of its own colour, and given to
/// its neighbours. One work-item per row of a tile; a step's cut is its first sample's to write.
/// Deterministic. Inputs as antialias_forward, and
/// in   grad_blended   float4[pixel]
/// out  grad_cut       Cut[2][pixel]  not written where nothing crosses
/// out  grad_raster    float4[pixel]
kernel void antialias_backward(const FrameParams p, global const uint* restrict tile_starts,
                               global const uint* restrict winner, global const float2* restrict cut,
                               global const float4* restrict raster,
                               global const float4* restrict grad_blended, global float2* restrict grad_cut,
                               global float4* restrict grad_raster) {
  const TileRow r = tile_row(p, (uint)get_global_id(0));
  if (r.count == 0) return;
  if (!may_be_crossed(p, r.tile, tile_starts)) {
    copy_row(r, grad_blended, grad_raster);
    return;
  }
  const uint pixels = p.views * p.width * p.height;
  for (uint i = 0; i < r.count; ++i) {
    const uint pixel = r.first + i;
    const uint2 at = r.at + (uint2)(i, 0u);
    const float4 grad = grad_blended[pixel];
    if (!is_crossed(p, pixel, at, pixels, winner)) {
      grad_raster[pixel] = grad;
      continue;
    }
    const Cell c = load_cell(p, pixel, at, pixels, winner, cut);
    const uint2 beside[DPR_STEPS] = {at + (uint2)(1u, 0u), at + (uint2)(0u, 1u), at - (uint2)(1u, 0u),
                                     at - (uint2)(0u, 1u)};
    float kept = 1.0f;
    float4 given = 0.0f;
#pragma unroll
    for (int k = 0; k < DPR_STEPS; ++k) {
      if (!c.is_crossed[k]) continue;
      const Cell other = load_cell(p, c.other[k], beside[k], pixels, winner, cut);
      const float4 grad_other = grad_blended[c.other[k]];
      kept -= c.part[k] / c.total;
      given += other.part[DPR_OPPOSITE(k)] / other.total * grad_other;
      if (k < 2) {
        grad_cut[c.step[k]] = gradient_at_end(c, k, pixel, raster, grad) +
                              gradient_at_end(other, DPR_OPPOSITE(k), c.other[k], raster, grad_other);
      }
    }
    grad_raster[pixel] = given + kept * grad;
  }
}
