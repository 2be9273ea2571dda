// Samples blended across the contours between them. Where a contour crosses the step between two neighbouring
// samples, the sample whose cell it cuts takes the other's colour for the part of the cell beyond: the image
// follows the contour, and its derivative by what is cut is the jump across it. What crosses, and how much it
// cuts, antialias_cross.cl finds.
//
// Few steps are crossed: a work-item takes a row of a tile, and copies it where no contour is near.
#include "contour.h"

/// The steps that cut a sample's cell: to the right, down, from the left, from above; and the same step as
/// the sample at its other end counts it.
#define DPR_STEPS 4
#define DPR_OPPOSITE(step) ((step) ^ 2)

typedef struct {
  uint step[DPR_STEPS], other[DPR_STEPS];  // the step, and the sample at its other end
  float weight[DPR_STEPS];                 // of that sample; 0 where the contour, if any, cuts the other cell
  float turn[DPR_STEPS];                   // d weight / d cut
  int cuts_other[DPR_STEPS];               // whether a contour cuts the other cell
  float total;                             // of the weights, or 1 if that is less
} Cell;

/// Whether anything crosses a step of the cell of a sample, in column and row `at` of its view.
static inline int is_crossed(const FrameParams p, uint pixel, uint2 at, uint pixels,
                             global const uint* restrict winner) {
  const uint left = at.x > 0 ? winner[pixel - 1] : DPR_NO_CROSSING;
  const uint above = at.y > 0 ? winner[pixels + pixel - p.width] : DPR_NO_CROSSING;
  return (winner[pixel] & winner[pixels + pixel] & left & above) != DPR_NO_CROSSING;
}

static inline Cell load_cell(const FrameParams p, uint pixel, uint2 at, uint pixels,
                             global const uint* restrict winner, global const float* restrict cut) {
  const int has[DPR_STEPS] = {1, 1, at.x > 0, at.y > 0};
  const uint first[DPR_STEPS] = {pixel, pixels + pixel, pixel - 1, pixels + pixel - p.width};
  const uint other[DPR_STEPS] = {pixel + 1, pixel + p.width, pixel - 1, pixel - p.width};
  Cell c;
  float sum = 0.0f;
#pragma unroll
  for (int k = 0; k < DPR_STEPS; ++k) {
    c.step[k] = first[k];
    c.other[k] = other[k];
    c.turn[k] = k < 2 ? -1.0f : 1.0f;
    c.weight[k] = 0.0f;
    c.cuts_other[k] = 0;
    if (!has[k] || winner[first[k]] == DPR_NO_CROSSING) continue;
    const float own_cut = cut[first[k]] * c.turn[k];
    c.weight[k] = fmax(own_cut, 0.0f);
    c.cuts_other[k] = own_cut < 0.0f;
    sum += c.weight[k];
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

/// A cell's colour. `own` is its sample's.
static inline float4 mixed_cell(const Cell c, float4 own, global const float4* restrict raster) {
  float4 sum = own;
#pragma unroll
  for (int k = 0; k < DPR_STEPS; ++k) {
    if (c.weight[k] > 0.0f) sum += c.weight[k] / c.total * (raster[c.other[k]] - own);
  }
  return sum;
}

/// Blends the samples. What crosses a cell on all sides may leave nothing of it: then the others share it.
/// One work-item per row of a tile. Deterministic.
/// in   tile_starts  uint[view * tile + 1]  runs of contours' pairs
/// in   winner, cut  as antialias_cross leaves them
/// in   raster       float4[pixel]  the samples
/// out  blended      float4[pixel]
kernel void antialias_forward(const FrameParams p, global const uint* restrict tile_starts,
                              global const uint* restrict winner, global const float* restrict cut,
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

/// The gradients of the cuts, and those of the samples: what each has kept of its own cell, and given to its
/// neighbours'. One work-item per row of a tile; each step cuts one cell, so no two write the same place.
/// Deterministic. Inputs as antialias_forward, and
/// in   grad_blended   float4[pixel]
/// out  grad_cut       float[2][pixel]  not written where nothing crosses
/// out  grad_raster    float4[pixel]
kernel void antialias_backward(const FrameParams p, global const uint* restrict tile_starts,
                               global const uint* restrict winner, global const float* restrict cut,
                               global const float4* restrict raster,
                               global const float4* restrict grad_blended, global float* restrict grad_cut,
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
    const float4 own = raster[pixel], grad = grad_blended[pixel];
    if (!is_crossed(p, pixel, at, pixels, winner)) {
      grad_raster[pixel] = grad;
      continue;
    }
    const Cell c = load_cell(p, pixel, at, pixels, winner, cut);
    // Where the weights are scaled to add up to 1, so is what one of them changes.
    const float4 from = c.total > 1.0f ? mixed_cell(c, own, raster) : own;
    const uint2 beside[DPR_STEPS] = {at + (uint2)(1u, 0u), at + (uint2)(0u, 1u), at - (uint2)(1u, 0u),
                                     at - (uint2)(0u, 1u)};
    float kept = 1.0f;
    float4 given = 0.0f;
    for (int k = 0; k < DPR_STEPS; ++k) {
      if (c.weight[k] > 0.0f) {
        kept -= c.weight[k] / c.total;
        grad_cut[c.step[k]] = c.turn[k] * dot(grad, raster[c.other[k]] - from) / c.total;
      }
      if (c.cuts_other[k]) {
        const Cell other = load_cell(p, c.other[k], beside[k], pixels, winner, cut);
        given += other.weight[DPR_OPPOSITE(k)] / other.total * grad_blended[c.other[k]];
      }
    }
    grad_raster[pixel] = given + kept * grad;
  }
}
