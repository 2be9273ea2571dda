// Samples blended across the contours between them. Where a contour crosses the step between two neighbouring samples, the
// sample whose cell it cuts takes the other's colour for the part of the cell beyond: the image follows the contour, and
// its derivative by what is cut is the jump across it. What crosses, and how much it cuts, antialias_cross.cl finds.
#include "shared_types.h"

/// The steps that cut a sample's cell: to the right, down, from the left, from above.
#define DPR_STEPS 4

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

/// A cell's colour. `own` is its sample's.
static inline float4 mixed_cell(const Cell c, float4 own, global const float4* restrict raster) {
  float4 sum = own;
  for (int k = 0; k < DPR_STEPS; ++k) {
    if (c.weight[k] > 0.0f) sum += c.weight[k] / c.total * (raster[c.other[k]] - own);
  }
  return sum;
}

/// Blends the samples. What crosses a cell on all sides may leave nothing of it: then the others share it. One work-item
/// per pixel. Deterministic.
/// in   winner, cut       [2][pixel]
/// in   raster            float4[pixel]
/// out  blended           float4[pixel]
kernel void antialias_forward(const FrameParams p, global const uint* restrict winner,
                              global const float* restrict cut, global const float4* restrict raster,
                              global float4* restrict blended) {
  const uint pixel = (uint)get_global_id(0), pixels = p.views * p.width * p.height;
  if (pixel >= pixels) return;
  const Cell c = load_cell(p, pixel, pixels, winner, cut);
  blended[pixel] = mixed_cell(c, raster[pixel], raster);
}

/// The gradients of the cuts, and every sample's part in its neighbour's cell. One work-item per pixel; each step
/// cuts one cell, so no two write the same place.
/// in   grad_blended   float4[pixel]
/// out  share          float[2][pixel]  of the step's other sample in the cell that it cuts; not written where nothing
///                                      crosses
/// out  grad_cut       float[2][pixel]  the same
kernel void antialias_backward(const FrameParams p, global const uint* restrict winner,
                               global const float* restrict cut, global const float4* restrict raster,
                               global const float4* restrict grad_blended, global float* restrict share,
                               global float* restrict grad_cut) {
  const uint pixel = (uint)get_global_id(0), pixels = p.views * p.width * p.height;
  if (pixel >= pixels) return;
  const Cell c = load_cell(p, pixel, pixels, winner, cut);
  const float4 own = raster[pixel], grad = grad_blended[pixel];
  // Where the weights are scaled to add up to 1, so is what one of them changes.
  const float4 from = c.total > 1.0f ? mixed_cell(c, own, raster) : own;
  for (int k = 0; k < DPR_STEPS; ++k) {
    if (!(c.weight[k] > 0.0f)) continue;
    share[c.step[k]] = c.weight[k] / c.total;
    grad_cut[c.step[k]] = c.turn[k] * dot(grad, raster[c.other[k]] - from) / c.total;
  }
}

/// The gradients of the samples: each gathers what it gave to its neighbours. One work-item per pixel. Deterministic.
/// in   share        float[2][pixel]
/// out  grad_raster  float4[pixel]
kernel void antialias_backward_samples(const FrameParams p, global const uint* restrict winner,
                                       global const float* restrict cut, global const float* restrict share,
                                       global const float4* restrict grad_blended,
                                       global float4* restrict grad_raster) {
  const uint pixel = (uint)get_global_id(0), pixels = p.views * p.width * p.height;
  if (pixel >= pixels) return;
  const Cell c = load_cell(p, pixel, pixels, winner, cut);
  float kept = 1.0f;
  float4 sum = 0.0f;
  for (int k = 0; k < DPR_STEPS; ++k) {
    if (c.weight[k] > 0.0f) kept -= c.weight[k] / c.total;
    if (c.cuts_other[k]) sum += share[c.step[k]] * grad_blended[c.other[k]];
  }
  grad_raster[pixel] = sum + kept * grad_blended[pixel];
}

