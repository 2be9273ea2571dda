// Samples blended across the contours between them. Where a contour crosses the step between two neighbouring samples,
// the sample whose cell it cuts takes the other's colour for the part of the cell beyond: the image follows the contour,
// and its derivative by what is cut is the jump across it. What crosses, and how much it cuts, antialias_cross.cl finds.
//
// Few steps are crossed: a work-item takes a row of a tile, and copies it where no contour is near.
#include "contour.h"

/// The steps that cut a sample's cell: to the right, down, from the left, from above; and the same step as the sample at its
/// other end counts it.
#define DPR_STEPS 4
#define DPR_OPPOSITE(step) ((step) ^ 2)

typedef struct {
  uint step[DPR_STEPS], other[DPR_STEPS];  // the step, and the sample at its other end
  float weight[DPR_STEPS];                 // of that sample; 0 where the contour, if any, cuts the other cell
  float turn[DPR_STEPS];                   // d weight / d cut
  int cuts_other[DPR_STEPS];               // whether a contour cuts the other cell
  float total;                             // of the weights, or 1 if that is less
} Cell;

static inline Cell load_cell(const FrameParams p, uint pixel, uint pixels, global const uint* restrict winner,
                             global const float* restrict cut) {
  const int has[DPR_STEPS] = {1, 1, pixel % p.width > 0, pixel / p.width % p.height > 0};
  const uint first[DPR_STEPS] = {pixel, pixels + pixel, pixel - 1, pixels + pixel - p.width};
  const uint other[DPR_STEPS] = {pixel + 1, pixel + p.width, pixel - 1, pixel - p.width};
  Cell c;
  float sum = 0.0f;
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

/// A row of a tile: `count` samples from `first` on; none below the raster.
typedef struct {
  uint tile, first, count;
} TileRow;

static inline TileRow tile_row(const FrameParams p, uint i) {
  TileRow r;
  r.tile = i / DPR_TILE;
  const TileSamples s = tile_samples(p, r.tile);
  const uint row = (uint)s.first_row + i % DPR_TILE, view = r.tile / (p.tiles_x * p.tiles_y);
  r.first = (view * p.height + row) * p.width + (uint)s.first_column;
  r.count = view < p.views && row < p.height ? (uint)(s.last_column - s.first_column) : 0;
  return r;
}

static inline void copy_row(TileRow r, global const float4* restrict from, global float4* restrict to) {
  for (uint k = 0; k < r.count; ++k) to[r.first + k] = from[r.first + k];
}

/// A cell's colour. `own` is its sample's.
static inline float4 mixed_cell(const Cell c, float4 own, global const float4* restrict raster) {
  float4 sum = own;
  for (int k = 0; k < DPR_STEPS; ++k) {
    if (c.weight[k] > 0.0f) sum += c.weight[k] / c.total * (raster[c.other[k]] - own);
  }
  return sum;
}

/// Blends the samples. What crosses a cell on all sides may leave nothing of it: then the others share it. One work-item
/// per row of a tile. Deterministic.
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
  for (uint pixel = r.first; pixel < r.first + r.count; ++pixel) {
    blended[pixel] = mixed_cell(load_cell(p, pixel, pixels, winner, cut), raster[pixel], raster);
  }
}

/// The gradients of the cuts, and those of the samples: what each has kept of its own cell, and given to its neighbours'.
/// One work-item per row of a tile; each step cuts one cell, so no two write the same place. Deterministic.
/// Inputs as antialias_forward, and
/// in   grad_blended   float4[pixel]
/// out  grad_cut       float[2][pixel]  not written where nothing crosses
/// out  grad_raster    float4[pixel]
kernel void antialias_backward(const FrameParams p, global const uint* restrict tile_starts,
                               global const uint* restrict winner, global const float* restrict cut,
                               global const float4* restrict raster, global const float4* restrict grad_blended,
                               global float* restrict grad_cut, global float4* restrict grad_raster) {
  const TileRow r = tile_row(p, (uint)get_global_id(0));
  if (r.count == 0) return;
  if (!may_be_crossed(p, r.tile, tile_starts)) {
    copy_row(r, grad_blended, grad_raster);
    return;
  }
  const uint pixels = p.views * p.width * p.height;
  for (uint pixel = r.first; pixel < r.first + r.count; ++pixel) {
    const Cell c = load_cell(p, pixel, pixels, winner, cut);
    const float4 own = raster[pixel], grad = grad_blended[pixel];
    // Where the weights are scaled to add up to 1, so is what one of them changes.
    const float4 from = c.total > 1.0f ? mixed_cell(c, own, raster) : own;
    float kept = 1.0f;
    float4 given = 0.0f;
    for (int k = 0; k < DPR_STEPS; ++k) {
      if (c.weight[k] > 0.0f) {
        kept -= c.weight[k] / c.total;
        grad_cut[c.step[k]] = c.turn[k] * dot(grad, raster[c.other[k]] - from) / c.total;
      }
      if (c.cuts_other[k]) {
        const Cell other = load_cell(p, c.other[k], pixels, winner, cut);
        given += other.weight[DPR_OPPOSITE(k)] / other.total * grad_blended[c.other[k]];
      }
    }
    grad_raster[pixel] = given + kept * grad;
  }
}
