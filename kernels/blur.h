// Places and sums of the passes of a blur (BlurPass).
#ifndef DPR_BLUR_H
#define DPR_BLUR_H

#include "blur_pixels.h"
#include "shared_types.h"

/// Outputs of a work-item along its pass: they share what they read, and their sums do not wait for each
/// other. Along rows, where they are vectors, they are fewer: the first and the last of a row, which read
/// beyond its ends, are slow.
#if DPR_LANES == 1
#define DPR_BLUR_BLOCK 4
#else
#define DPR_BLUR_BLOCK 8
#endif
#define DPR_BLUR_ROW_BLOCK 4

/// Blocks beside each other of a work-item: on a CPU finding its place takes as long as one does.
#if DPR_LANES == 1
#define DPR_BLUR_BLOCKS 1
#else
#define DPR_BLUR_BLOCKS 4
#endif

/// Pixels beside each other of a work-item along columns; and along rows, of a block and of a work-item.
#define DPR_BLUR_WIDTH (DPR_BLUR_BLOCKS * DPR_BLUR_PIXELS)
#define DPR_BLUR_ROW (DPR_BLUR_ROW_BLOCK * DPR_BLUR_PIXELS)
#define DPR_BLUR_ROW_LENGTH (DPR_BLUR_BLOCKS * DPR_BLUR_ROW)

/// Place of a work-item's outputs.
typedef struct {
  uint image;     /* along columns */
  size_t in, out; /* first pixel of the column's or row's input; first output pixel */
  int at;         /* place of the first output along the pass */
  int steps; /* outputs along the pass: at most DPR_BLUR_BLOCK along columns, DPR_BLUR_ROW_LENGTH along rows */
  int count; /* along columns: neighbours in a row, at most DPR_BLUR_WIDTH */
} BlurPlace;

/// Inputs [from, to) that count for a block of outputs; `last` is the tap of input 0 for the first of them.
/// Beyond its taps the table holds as many zeros as the block's other outputs are away.
typedef struct {
  int from, to, last;
} BlurTaps;

static inline int blur_padding(const BlurPass p) { return (DPR_BLUR_BLOCK - 1) * max(p.out_step, p.in_step); }

static inline BlurTaps block_taps(const BlurPass p, int at, int block) {
  BlurTaps t;
  t.last = at * p.out_step + p.offset;
  const int before = t.last - p.taps + 1, highest = t.last + (block - 1) * p.out_step;
  t.from = before > 0 ? (before + p.in_step - 1) / p.in_step : 0;
  t.to = highest < 0 ? 0 : min(highest / p.in_step + 1, (int)p.in_length);
  t.last += blur_padding(p);
  return t;
}

static inline uint groups_of(uint items, uint group) { return (items + group - 1) / group; }

/// One work-item per (image, block of output rows, DPR_BLUR_WIDTH pixels).
static inline uint column_items_per_image(const BlurPass p) {
  return groups_of(p.out_length, DPR_BLUR_BLOCK) * groups_of(p.width, DPR_BLUR_WIDTH);
}
static inline BlurPlace column_place(const BlurPass p, uint i) {
  const uint items = groups_of(p.width, DPR_BLUR_WIDTH), blocks = groups_of(p.out_length, DPR_BLUR_BLOCK);
  const uint line = i / items, x = (i - line * items) * DPR_BLUR_WIDTH, image = line / blocks;
  BlurPlace place;
  place.image = image;
  place.at = (int)((line - image * blocks) * DPR_BLUR_BLOCK);
  place.in = (size_t)image * p.in_length * p.width + x - p.in_shift;
  place.out = ((size_t)image * p.out_length + (size_t)place.at) * p.width + x - p.out_shift;
  place.steps = min((int)p.out_length - place.at, DPR_BLUR_BLOCK);
  place.count = min((int)(p.width - x), DPR_BLUR_WIDTH);
  return place;
}

/// One work-item per (row, DPR_BLUR_ROW_LENGTH output pixels).
static inline uint row_items_per_line(const BlurPass p) {
  return groups_of(p.out_length, DPR_BLUR_ROW_LENGTH);
}
static inline BlurPlace row_place(const BlurPass p, uint i) {
  const uint items = row_items_per_line(p), row = i / items;
  BlurPlace place;
  place.image = 0;
  place.at = (int)((i - row * items) * DPR_BLUR_ROW_LENGTH);
  place.in = (size_t)row * p.in_length;
  place.out = (size_t)row * p.out_length + (size_t)place.at;
  place.steps = min((int)p.out_length - place.at, DPR_BLUR_ROW_LENGTH);
  place.count = 1;
  return place;
}

/// The samples that inputs along a pass, or across it, are made of; ranges are half open.
static inline int2 samples_along(const BlurPass p, int2 inputs) {
  return (int2)(inputs.x * p.along_step + p.along_first, (inputs.y - 1) * p.along_step + p.along_end);
}
static inline int2 samples_across(const BlurPass p, int2 inputs) {
  return (int2)(inputs.x * p.across_step + p.across_first, (inputs.y - 1) * p.across_step + p.across_end);
}

/// True if a rectangle of samples lies outside of the extents. One row of tiles more is asked on each side.
static inline int is_outside(const BlurPass p, global const uint2* restrict extents, uint image, int2 rows,
                             int2 columns) {
  const int first = max(rows.x / DPR_TILE - 1, 0),
            last = min((rows.y - 1) / DPR_TILE + 1, (int)p.tile_rows - 1);
  for (int row = first; row <= last; ++row) {
    const int2 extent = as_int2(extents[image % p.views * p.tile_rows + (uint)row]);
    if (columns.x < extent.y && columns.y > extent.x) return 0;
  }
  return 1;
}

/// True if all that a block of outputs has taps for is there: else its sum is not that of all weights.
static inline int has_all_taps(const BlurPass p, int at, int block) {
  const int last = at * p.out_step + p.offset;
  return last - p.taps + 1 >= 0 && (last + (block - 1) * p.out_step) / p.in_step < (int)p.in_length;
}

/// True if all inputs of a block along columns show the background.
static inline int is_outside_columns(const BlurPass p, const BlurPlace place,
                                     global const uint2* restrict extents) {
  if (p.tile_rows == 0 || !has_all_taps(p, place.at, place.steps)) return 0;
  const BlurTaps t = block_taps(p, place.at, place.steps);
  const int x = (int)(place.in + p.in_shift - (size_t)place.image * p.in_length * p.width);
  return is_outside(p, extents, place.image, samples_along(p, (int2)(t.from, t.to)),
                    samples_across(p, (int2)(x, x + place.count)));
}

/// The same of outputs from `at` on along `count` rows.
static inline int is_outside_rows(const BlurPass p, uint row, uint count, int at, int steps,
                                  global const uint2* restrict extents) {
  if (p.tile_rows == 0 || !has_all_taps(p, at, steps)) return 0;
  const uint image = row / p.image_lines;
  if ((row + count - 1) / p.image_lines != image) return 0;
  const BlurTaps t = block_taps(p, at, steps);
  const int y = (int)(row - image * p.image_lines);
  return is_outside(p, extents, image, samples_across(p, (int2)(y, y + (int)count)),
                    samples_along(p, (int2)(t.from, t.to)));
}

/// The sums of a block of outputs. Loops over them are unrolled, also those that end sooner, so that they
/// stay in registers.
static inline void fill_sums(pixels_n value, pixels_n* sums) {
#pragma unroll
  for (int k = 0; k < DPR_BLUR_BLOCK; ++k) sums[k] = value;
}

/// Adds an input to them all, whose weights are `step` apart.
static inline void add_to_sums(global const float* weights, int step, pixels_n value, pixels_n* sums) {
#pragma unroll
  for (int k = 0; k < DPR_BLUR_BLOCK; ++k) sums[k] += weights[k * step] * value;
}

/// Sums of a block of rows that lie as the block's outputs do, from its pixel `x` on.
static inline void load_sums(const BlurPass p, const BlurPlace place, int x, global const float4* from,
                             pixels_n* sums) {
#pragma unroll
  for (int row = 0; row < DPR_BLUR_BLOCK; ++row) {
    if (row >= place.steps) break;
    sums[row] = load_pixels(from + (place.out + (size_t)x) + (size_t)row * p.width);
  }
}

/// Adds inputs to a block's sums, in order. Lanes from its count on, and rows from its steps on, are of no use.
static inline void add_columns(const BlurPass p, const BlurPlace place, int x, const BlurTaps t,
                               global const float* restrict weights, global const float4* restrict in,
                               pixels_n* sums) {
  const int from = max(t.from, p.first_row), to = min(t.to, p.last_row);
  in += place.in + (size_t)x;
#if DPR_LANES > 1
  // Each sum by its own taps: zeros beyond them cost as much as they do.
  if (p.out_step == 1 && p.in_step == 1 && to - from == p.taps + DPR_BLUR_BLOCK - 1 &&
      place.steps == DPR_BLUR_BLOCK) {
    in += (size_t)from * p.width;
    for (int k = 0; k < p.taps; ++k) {
      const float weight = weights[t.last - from - k];
#pragma unroll
      for (int row = 0; row < DPR_BLUR_BLOCK; ++row)
        sums[row] += weight * load_pixels(in + (size_t)(k + row) * p.width);
    }
    return;
  }
#endif
  for (int k = from; k < to; ++k) {
    add_to_sums(weights + (t.last - k * p.in_step), p.out_step, load_pixels(in + (size_t)k * p.width), sums);
  }
}

/// Sums of DPR_BLUR_ROW pixels of a row, `at` along the pass, by blocks that share what they read. Those from `steps`
/// on hold nothing of use.
static inline void row_sums_by_pixel(const BlurPass p, int at, int steps,
                                     global const float* restrict weights, global const float4* restrict in,
                                     float4* sums) {
#pragma unroll
  for (int first = 0; first < DPR_BLUR_ROW; first += DPR_BLUR_ROW_BLOCK) {
    if (first >= steps) break;
    const BlurTaps t = block_taps(p, at + first, DPR_BLUR_ROW_BLOCK);
    float4 sum0 = 0.0f, sum1 = 0.0f, sum2 = 0.0f, sum3 = 0.0f;
    for (int k = t.from; k < t.to; ++k) {
      const float4 value = in[k];
      global const float* w = weights + (t.last - k * p.in_step);
      sum0 += w[0] * value;
      sum1 += w[p.out_step] * value;
      sum2 += w[2 * p.out_step] * value;
      sum3 += w[3 * p.out_step] * value;
    }
    sums[first] = sum0;
    sums[first + 1] = sum1;
    sums[first + 2] = sum2;
    sums[first + 3] = sum3;
  }
}

/// The same where neighbouring outputs read neighbouring inputs, all of which are there: by vectors.
static inline void row_sums_by_vector(const BlurPass p, int at, global const float* restrict weights,
                                      global const float4* restrict in, pixels_n* sums) {
  global const float4* last = in + (at + p.offset);
  global const float* w = weights + blur_padding(p);
  pixels_n sum0 = 0.0f, sum1 = 0.0f, sum2 = 0.0f, sum3 = 0.0f;
  for (int k = 0; k < p.taps; ++k) {
    sum0 += w[k] * load_pixels(last - k);
    sum1 += w[k] * load_pixels(last - k + DPR_BLUR_PIXELS);
    sum2 += w[k] * load_pixels(last - k + 2 * DPR_BLUR_PIXELS);
    sum3 += w[k] * load_pixels(last - k + 3 * DPR_BLUR_PIXELS);
  }
  sums[0] = sum0;
  sums[1] = sum1;
  sums[2] = sum2;
  sums[3] = sum3;
}

static inline void row_sums(const BlurPass p, int at, int steps, global const float* restrict weights,
                            global const float4* restrict in, pixels_n sums[DPR_BLUR_ROW_BLOCK]) {
  const int last = at + p.offset;
  const int is_inside = last >= p.taps - 1 && last + DPR_BLUR_ROW <= (int)p.in_length;
  if (p.in_step == 1 && p.out_step == 1 && is_inside) {
    row_sums_by_vector(p, at, weights, in, sums);
  } else {
    row_sums_by_pixel(p, at, steps, weights, in, (float4*)sums);
  }
}

#endif
