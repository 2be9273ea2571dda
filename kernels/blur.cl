// Blur of the rigid image by the noise of the pixel's position, I(x) = E[R(x + s Z)]: passes along columns
// and rows, all of one form (BlurPass). The transpose is a pass too, so backward needs no kernels of its own.
// The order of additions is fixed.
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

/// Place of a work-item's outputs.
typedef struct {
  uint image;     /* along columns */
  size_t in, out; /* first pixel of the column's or row's input; first output pixel */
  int at;         /* place of the first output along the pass */
  int steps;      /* outputs along the pass: at most DPR_BLUR_BLOCK along columns, DPR_BLUR_ROW along rows */
  int count;      /* along columns: neighbours in a row, at most DPR_BLUR_PIXELS */
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

/// One work-item per (image, block of output rows, vector of pixels).
static inline uint column_items_per_image(const BlurPass p) {
  return groups_of(p.out_length, DPR_BLUR_BLOCK) * groups_of(p.width, DPR_BLUR_PIXELS);
}
static inline BlurPlace column_place(const BlurPass p, uint i) {
  const uint vectors = groups_of(p.width, DPR_BLUR_PIXELS), blocks = groups_of(p.out_length, DPR_BLUR_BLOCK);
  const uint x = i % vectors * DPR_BLUR_PIXELS, image = i / vectors / blocks;
  BlurPlace place;
  place.image = image;
  place.at = (int)(i / vectors % blocks * DPR_BLUR_BLOCK);
  place.in = (size_t)image * p.in_length * p.width + x - p.in_shift;
  place.out = ((size_t)image * p.out_length + (size_t)place.at) * p.width + x - p.out_shift;
  place.steps = min((int)p.out_length - place.at, DPR_BLUR_BLOCK);
  place.count = min((int)(p.width - x), DPR_BLUR_PIXELS);
  return place;
}

/// One work-item per (row, block of vectors of output pixels).
#define DPR_BLUR_ROW (DPR_BLUR_ROW_BLOCK * DPR_BLUR_PIXELS)
static inline uint row_items_per_line(const BlurPass p) { return groups_of(p.out_length, DPR_BLUR_ROW); }
static inline BlurPlace row_place(const BlurPass p, uint i) {
  const uint blocks = row_items_per_line(p), row = i / blocks;
  BlurPlace place;
  place.image = 0;
  place.at = (int)(i % blocks * DPR_BLUR_ROW);
  place.in = (size_t)row * p.in_length;
  place.out = (size_t)row * p.out_length + (size_t)place.at;
  place.steps = min((int)p.out_length - place.at, DPR_BLUR_ROW);
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

/// Sums of a block of rows that lie as the block's outputs do.
static inline void load_sums(const BlurPass p, const BlurPlace place, global const float4* from,
                             pixels_n* sums) {
#pragma unroll
  for (int row = 0; row < DPR_BLUR_BLOCK; ++row) {
    if (row >= place.steps) break;
    sums[row] = load_pixels(from + place.out + (size_t)row * p.width);
  }
}

/// Adds inputs to a block's sums, in order. Lanes from its count on, and rows from its steps on, are of no use.
static inline void add_columns(const BlurPass p, const BlurPlace place, const BlurTaps t,
                               global const float* restrict weights, global const float4* restrict in,
                               pixels_n* sums) {
  for (int k = max(t.from, p.first_row); k < min(t.to, p.last_row); ++k) {
    add_to_sums(weights + (t.last - k * p.in_step), p.out_step,
                load_pixels(in + place.in + (size_t)k * p.width), sums);
  }
}

/// Sums of DPR_BLUR_ROW pixels of a row, by blocks that share what they read. Those from the place's steps on
/// hold nothing of use.
static inline void row_sums_by_pixel(const BlurPass p, const BlurPlace place,
                                     global const float* restrict weights, global const float4* restrict in,
                                     float4* sums) {
#pragma unroll
  for (int first = 0; first < DPR_BLUR_ROW; first += DPR_BLUR_ROW_BLOCK) {
    if (first >= place.steps) break;
    const BlurTaps t = block_taps(p, place.at + first, DPR_BLUR_ROW_BLOCK);
    float4 sum0 = 0.0f, sum1 = 0.0f, sum2 = 0.0f, sum3 = 0.0f;
    for (int k = t.from; k < t.to; ++k) {
      const float4 value = in[place.in + (size_t)k];
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
static inline void row_sums_by_vector(const BlurPass p, const BlurPlace place,
                                      global const float* restrict weights, global const float4* restrict in,
                                      float4* sums) {
  global const float4* last = in + place.in + (place.at + p.offset);
  global const float* w = weights + blur_padding(p);
  pixels_n sum0 = 0.0f, sum1 = 0.0f, sum2 = 0.0f, sum3 = 0.0f;
  for (int k = 0; k < p.taps; ++k) {
    sum0 += w[k] * load_pixels(last - k);
    sum1 += w[k] * load_pixels(last - k + DPR_BLUR_PIXELS);
    sum2 += w[k] * load_pixels(last - k + 2 * DPR_BLUR_PIXELS);
    sum3 += w[k] * load_pixels(last - k + 3 * DPR_BLUR_PIXELS);
  }
  store_lanes(sum0, sums);
  store_lanes(sum1, sums + DPR_BLUR_PIXELS);
  store_lanes(sum2, sums + 2 * DPR_BLUR_PIXELS);
  store_lanes(sum3, sums + 3 * DPR_BLUR_PIXELS);
}

static inline void row_sums(const BlurPass p, const BlurPlace place, global const float* restrict weights,
                            global const float4* restrict in, float4* sums) {
  const int last = place.at + p.offset;
  const int is_inside = last >= p.taps - 1 && last + DPR_BLUR_ROW <= (int)p.in_length;
  if (p.in_step == 1 && p.out_step == 1 && is_inside) {
    row_sums_by_vector(p, place, weights, in, sums);
  } else {
    row_sums_by_pixel(p, place, weights, in, sums);
  }
}

/// Sum over at most `most` pixels, a constant, of products by channel.
static inline float4 product_of_pixels(const float4* a, global const float4* restrict b, int count,
                                       int most) {
  float4 sum = 0.0f;
#pragma unroll
  for (int k = 0; k < most; ++k) {
    if (k >= count) break;
    sum += a[k] * b[k];
  }
  return sum;
}

static inline float sum_of_channels(float4 v) { return v.x + v.y + v.z + v.w; }

/// The samples of each row of tiles that may differ from one another: those of the tiles that have pairs, and
/// of one more on each side, since contours blend samples with their neighbours. All others show the
/// background.
///
/// NDRange: one work-item per row of tiles of all views.
/// in   tile_starts  uint[view * tile + 1]  runs of pairs
/// out  extents      uint2[view][row of tiles]  the first column, and the one after the last
kernel void blur_extents(const FrameParams p, global const uint* restrict tile_starts,
                         global uint2* restrict extents) {
  const uint row = (uint)get_global_id(0);
  if (row >= p.views * p.tiles_y) return;
  global const uint* starts = tile_starts + row * p.tiles_x;
  uint first = p.tiles_x, last = 0;
  for (uint x = 0; x < p.tiles_x; ++x) {
    const int is_covered = starts[x] != starts[x + 1];
    first = is_covered && x < first ? x : first;
    last = is_covered ? x : last;
  }
  const uint begin = first > 0 ? (first - 1) * DPR_TILE : 0;
  const int is_empty = first == p.tiles_x;
  // Number by number: LLVM 18, in PoCL 6, aborts at a vector that is selected.
  extents[row].x = is_empty ? 0 : begin;
  extents[row].y = is_empty ? 0 : (last + 2) * DPR_TILE;
}

/// Along columns. Where several launches add the rows of inputs, in order, outputs hold the sums so far. NDRange:
/// one work-item per (image, block of output rows, vector of pixels), up to p.items.
/// in   extents  as blur_extents leaves them, where p.tile_rows says so: blocks outside are not summed up
/// in   weights  float[tap], between zeros (BlurTaps)
/// in   in       float4[image][in_length][width]
/// in out  out   float4[image][out_length][width]
kernel void blur_columns(const BlurPass p, global const uint2* restrict extents,
                         global const float* restrict weights, global const float4* restrict in,
                         global float4* restrict out) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.items) return;
  const BlurPlace place = column_place(p, i);
  const BlurTaps t = block_taps(p, place.at, DPR_BLUR_BLOCK);
  const int is_before = t.to <= p.first_row && p.first_row > 0,
            is_after = t.from >= p.last_row && p.last_row < (int)p.in_length;
  if (is_before || is_after) return;
  pixels_n sums[DPR_BLUR_BLOCK];
  fill_sums((pixels_n)(0.0f), sums);
  if (is_outside_columns(p, place, extents)) {
    if (t.from < p.first_row) return;
    fill_sums(load_pixels(in + place.in + (size_t)t.from * p.width), sums);
  } else {
    if (t.from < p.first_row) load_sums(p, place, out, sums);
    add_columns(p, place, t, weights, in, sums);
  }
#pragma unroll
  for (int row = 0; row < DPR_BLUR_BLOCK; ++row) {
    if (row >= place.steps) break;
    global float4* to = out + place.out + (size_t)row * p.width;
    if (place.count == DPR_BLUR_PIXELS) {
      store_pixels(sums[row], to);
    } else {
      float4 lanes[DPR_BLUR_PIXELS];
      store_lanes(sums[row], lanes);
      for (int lane = 0; lane < place.count; ++lane) to[lane] = lanes[lane];
    }
  }
}

/// Along rows, where neighbouring outputs read neighbouring inputs. NDRange: one work-item per (row, block of
/// vectors of output pixels).
/// in   extents  as blur_columns
/// in   weights  float[tap], between zeros (BlurTaps)
/// in   in       float4[row][in_length]
/// out  out      float4[row][out_length]
kernel void blur_rows(const BlurPass p, global const uint2* restrict extents,
                      global const float* restrict weights, global const float4* restrict in,
                      global float4* restrict out) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.lines * row_items_per_line(p)) return;
  const BlurPlace place = row_place(p, i);
  if (is_outside_rows(p, i / row_items_per_line(p), 1, place.at, place.steps, extents)) {
    const float4 value = in[place.in + (size_t)block_taps(p, place.at, place.steps).from];
    for (int k = 0; k < place.steps; ++k) out[place.out + (size_t)k] = value;
    return;
  }
  float4 sums[DPR_BLUR_ROW];
  row_sums(p, place, weights, in, sums);
#pragma unroll
  for (int k = 0; k < DPR_BLUR_ROW; ++k) {
    if (k >= place.steps) break;
    out[place.out + (size_t)k] = sums[k];
  }
}

/// Along rows, where outputs or inputs are further apart. NDRange: one work-item per (DPR_BLUR_PIXELS rows,
/// block of outputs); a lane is a row. Otherwise as blur_rows.
kernel void blur_rows_strided(const BlurPass p, global const uint2* restrict extents,
                              global const float* restrict weights, global const float4* restrict in,
                              global float4* restrict out) {
  const uint i = (uint)get_global_id(0), blocks = groups_of(p.out_length, DPR_BLUR_BLOCK);
  if (i >= groups_of(p.lines, DPR_BLUR_PIXELS) * blocks) return;
  const uint first = i / blocks * DPR_BLUR_PIXELS, at = i % blocks * DPR_BLUR_BLOCK;
  global const float4* lines[DPR_BLUR_PIXELS];
  for (uint lane = 0; lane < DPR_BLUR_PIXELS; ++lane)
    lines[lane] = in + (size_t)min(first + lane, p.lines - 1) * p.in_length;
  const uint steps = min(p.out_length - at, (uint)DPR_BLUR_BLOCK),
             count = min(p.lines - first, (uint)DPR_BLUR_PIXELS);
  const BlurTaps t = block_taps(p, (int)at, DPR_BLUR_BLOCK);
  pixels_n sums[DPR_BLUR_BLOCK];
  if (is_outside_rows(p, first, count, (int)at, (int)steps, extents)) {
    fill_sums(join_lines(lines, t.from), sums);
  } else {
    fill_sums((pixels_n)(0.0f), sums);
    for (int k = t.from; k < t.to; ++k)
      add_to_sums(weights + (t.last - k * p.in_step), p.out_step, join_lines(lines, k), sums);
  }
#pragma unroll
  for (uint step = 0; step < DPR_BLUR_BLOCK; ++step) {
    if (step >= steps) break;
    float4 lanes[DPR_BLUR_PIXELS];
    store_lanes(sums[step], lanes);
    for (uint lane = 0; lane < count; ++lane)
      out[(size_t)(first + lane) * p.out_length + at + step] = lanes[lane];
  }
}

/// A pass's share of the derivative by the scale: its output, with the weights' derivative, times the
/// gradient of the output. NDRange as blur_columns.
/// in   extents  as blur_columns: outside the weights' derivative sums to 0
/// in   weights  float[tap]  derivative, between zeros
/// in   in, grad            as in and out of blur_columns; or in is what that has added up, if p.has_sums says so
/// out  products  float      that of work-item i of image v: [v * stride + first + i]
kernel void blur_columns_scale(const BlurPass p, const uint stride, const uint first,
                               global const uint2* restrict extents, global const float* restrict weights,
                               global const float4* restrict in, global const float4* restrict grad,
                               global float* restrict products) {
  const uint i = (uint)get_global_id(0), items = column_items_per_image(p);
  if (i >= p.items) return;
  const BlurPlace place = column_place(p, i);
  global float* to = products + (i / items * stride + first + i % items);
  if (is_outside_columns(p, place, extents)) {
    *to = 0.0f;
    return;
  }
  pixels_n sums[DPR_BLUR_BLOCK];
  fill_sums((pixels_n)(0.0f), sums);
  if (p.has_sums) {
    load_sums(p, place, in, sums);
  } else {
    add_columns(p, place, block_taps(p, place.at, DPR_BLUR_BLOCK), weights, in, sums);
  }
  float4 product = 0.0f;
#pragma unroll
  for (int row = 0; row < DPR_BLUR_BLOCK; ++row) {
    if (row >= place.steps) break;
    float4 lanes[DPR_BLUR_PIXELS];
    store_lanes(sums[row], lanes);
    product +=
        product_of_pixels(lanes, grad + place.out + (size_t)row * p.width, place.count, DPR_BLUR_PIXELS);
  }
  *to = sum_of_channels(product);
}

/// The same along rows, of which each image has `rows`: as blur_columns_scale, with the NDRange of blur_rows.
/// It asks no extents: with them NVIDIA's registers would not hold the sums.
kernel void blur_rows_scale(const BlurPass p, const uint stride, const uint first, const uint rows,
                            global const float* restrict weights, global const float4* restrict in,
                            global const float4* restrict grad, global float* restrict products) {
  const uint i = (uint)get_global_id(0), items = rows * row_items_per_line(p);
  if (i >= p.lines * row_items_per_line(p)) return;
  const BlurPlace place = row_place(p, i);
  float4 sums[DPR_BLUR_ROW];
  row_sums(p, place, weights, in, sums);
  products[i / items * stride + first + i % items] =
      sum_of_channels(product_of_pixels(sums, grad + place.out, place.steps, DPR_BLUR_ROW));
}
