// Samples blended across the contours between them. Where a contour crosses the step between two neighbouring samples,
// the sample whose cell it cuts takes the other's colour for the part of the cell beyond: the image follows the contour,
// and its derivative by what is cut is the jump across it. What crosses, and how much it cuts, antialias_cross.cl finds.
//
// Few steps are crossed: a work-item takes a vector of samples, and copies it where none of them is.
#include "lanes.h"
#include "shared_types.h"

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

/// False only if nothing crosses the steps of a vector of samples.
static inline int may_be_crossed(const FrameParams p, uint pixel, uint pixels, global const uint* restrict winner) {
  const uintn none = DPR_NO_CROSSING;
  return any_lane(load_n(pixel, winner) != none || load_n(max(pixel, 1u) - 1, winner) != none ||
                  load_n(pixels + pixel, winner) != none || load_n(pixels + pixel - p.width, winner) != none);
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
/// per vector of samples. Deterministic.
/// in   winner, cut  as antialias_cross leaves them
/// in   raster       float4[pixel]  the samples
/// out  blended      float4[pixel]
kernel void antialias_forward(const FrameParams p, global const uint* restrict winner,
                              global const float* restrict cut, global const float4* restrict raster,
                              global float4* restrict blended) {
  const uint first = (uint)get_global_id(0) * DPR_WIDTH, pixels = p.views * p.width * p.height;
  if (first >= pixels) return;
  const uint last = min(first + DPR_WIDTH, pixels);
  const int is_crossed = may_be_crossed(p, first, pixels, winner);
  for (uint pixel = first; pixel < last; ++pixel) {
    blended[pixel] = raster[pixel];
    if (is_crossed) blended[pixel] = mixed_cell(load_cell(p, pixel, pixels, winner, cut), raster[pixel], raster);
  }
}

/// The gradients of the cuts, and those of the samples: what each has kept of its own cell, and given to its neighbours'.
/// One work-item per vector of samples; each step cuts one cell, so no two write the same place. Deterministic.
/// Inputs as antialias_forward, and
/// in   grad_blended   float4[pixel]
/// out  grad_cut       float[2][pixel]  not written where nothing crosses
/// out  grad_raster    float4[pixel]
kernel void antialias_backward(const FrameParams p, global const uint* restrict winner,
                               global const float* restrict cut, global const float4* restrict raster,
                               global const float4* restrict grad_blended, global float* restrict grad_cut,
                               global float4* restrict grad_raster) {
  const uint first = (uint)get_global_id(0) * DPR_WIDTH, pixels = p.views * p.width * p.height;
  if (first >= pixels) return;
  const uint last = min(first + DPR_WIDTH, pixels);
  if (!may_be_crossed(p, first, pixels, winner)) {
    for (uint pixel = first; pixel < last; ++pixel) grad_raster[pixel] = grad_blended[pixel];
    return;
  }
  for (uint pixel = first; pixel < last; ++pixel) {
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
