// Blur of the rigid image by the noise of the pixel's position, I(x) = E[R(x + s Z)]: passes along columns and rows, all of
// one form (BlurPass). The transpose is a pass too, so backward needs no kernels of its own. The order of additions is
// fixed.
#include "shared_types.h"

#ifndef DPR_LANES
#define DPR_LANES 8 /* the device's width; the host chooses it */
#endif

/// Neighbours of a row in one vector.
#if DPR_LANES == 16
#define DPR_BLUR_PIXELS 4
typedef float16 pixels_n;
#define load_pixels(pointer) vload16(0, (global const float*)(pointer))
#define load_lanes(lanes) vload16(0, (const float*)(lanes))
#define store_pixels(value, pointer) vstore16(value, 0, (global float*)(pointer))
#define store_lanes(value, lanes) vstore16(value, 0, (float*)(lanes))
#elif DPR_LANES == 8
#define DPR_BLUR_PIXELS 2
typedef float8 pixels_n;
#define load_pixels(pointer) vload8(0, (global const float*)(pointer))
#define load_lanes(lanes) vload8(0, (const float*)(lanes))
#define store_pixels(value, pointer) vstore8(value, 0, (global float*)(pointer))
#define store_lanes(value, lanes) vstore8(value, 0, (float*)(lanes))
#else
#define DPR_BLUR_PIXELS 1
typedef float4 pixels_n;
#define load_pixels(pointer) (*(pointer))
#define load_lanes(lanes) ((lanes)[0])
#define store_pixels(value, pointer) (*(pointer) = (value))
#define store_lanes(value, lanes) ((lanes)[0] = (value))
#endif

/// Where a work-item's pixels are.
typedef struct {
  size_t in, out; /* first element of the column's or row's input; first output pixel */
  uint at, count; /* place of the first output along the pass; pixels, at most DPR_BLUR_PIXELS */
} BlurPlace;

/// Of the inputs [from, to) that count at an output; `last` is the tap of input 0.
typedef struct {
  int from, to, last;
} BlurTaps;

static inline BlurTaps taps_at(const BlurPass p, uint at) {
  BlurTaps t;
  t.last = (int)at * p.out_step + p.offset;
  const int before = t.last - p.taps + 1;
  t.from = before > 0 ? (before + p.in_step - 1) / p.in_step : 0;
  t.to = t.last < 0 ? 0 : min(t.last / p.in_step + 1, (int)p.in_length);
  return t;
}

static inline uint vectors_of(uint pixels) { return (pixels + DPR_BLUR_PIXELS - 1) / DPR_BLUR_PIXELS; }

/// One work-item per (image, output row, vector of pixels).
static inline BlurPlace column_place(const BlurPass p, uint i) {
  const uint vectors = vectors_of(p.width), x = i % vectors * DPR_BLUR_PIXELS, row = i / vectors;
  BlurPlace place;
  place.at = row % p.out_length;
  place.in = (size_t)(row / p.out_length) * p.in_length * p.width + x;
  place.out = (size_t)row * p.width + x;
  place.count = min(p.width - x, (uint)DPR_BLUR_PIXELS);
  return place;
}

/// One work-item per (row, vector of pixels).
static inline BlurPlace row_place(const BlurPass p, uint i) {
  const uint vectors = vectors_of(p.out_length), row = i / vectors;
  BlurPlace place;
  place.at = i % vectors * DPR_BLUR_PIXELS;
  place.in = (size_t)row * p.in_length;
  place.out = (size_t)row * p.out_length + place.at;
  place.count = min(p.out_length - place.at, (uint)DPR_BLUR_PIXELS);
  return place;
}

static inline uint column_items(const BlurPass p) { return p.lines * p.out_length * vectors_of(p.width); }
static inline uint row_items(const BlurPass p) { return p.lines * vectors_of(p.out_length); }

/// Lanes from the place's count on hold nothing of use.
static inline pixels_n column_sums(const BlurPass p, const BlurPlace place, global const float* restrict weights,
                                   global const float4* restrict in) {
  const BlurTaps t = taps_at(p, place.at);
  pixels_n sum = 0.0f;
  for (int k = t.from; k < t.to; ++k) {
    sum += weights[t.last - k * p.in_step] * load_pixels(in + place.in + (size_t)k * p.width);
  }
  return sum;
}

static inline float4 row_sum(const BlurPass p, uint at, global const float* restrict weights,
                             global const float4* restrict in) {
  const BlurTaps t = taps_at(p, at);
  float4 sum = 0.0f;
  for (int k = t.from; k < t.to; ++k) sum += weights[t.last - k * p.in_step] * in[k];
  return sum;
}

/// The same along a row. Where neighbouring outputs read neighbouring inputs, and all of them are there, a vector is
/// summed at once.
static inline pixels_n row_sums(const BlurPass p, const BlurPlace place, global const float* restrict weights,
                                global const float4* restrict in) {
  const int last = (int)place.at + p.offset;
  if (p.in_step == 1 && p.out_step == 1 && last >= p.taps - 1 && last + DPR_BLUR_PIXELS <= (int)p.in_length) {
    pixels_n sum = 0.0f;
    for (int k = 0; k < p.taps; ++k) sum += weights[k] * load_pixels(in + place.in + (last - k));
    return sum;
  }
  float4 lanes[DPR_BLUR_PIXELS];
  for (uint lane = 0; lane < DPR_BLUR_PIXELS; ++lane) {
    lanes[lane] = lane < place.count ? row_sum(p, place.at + lane, weights, in + place.in) : (float4)(0.0f);
  }
  return load_lanes(lanes);
}

static inline void store_sums(pixels_n sums, const BlurPlace place, global float4* restrict out) {
  if (place.count == DPR_BLUR_PIXELS) {
    store_pixels(sums, out + place.out);
    return;
  }
  float4 lanes[DPR_BLUR_PIXELS];
  store_lanes(sums, lanes);
  for (uint lane = 0; lane < place.count; ++lane) out[place.out + lane] = lanes[lane];
}

static inline float dot_sums(pixels_n sums, const BlurPlace place, global const float4* restrict grad) {
  float4 lanes[DPR_BLUR_PIXELS];
  store_lanes(sums, lanes);
  float total = 0.0f;
  for (uint lane = 0; lane < place.count; ++lane) total += dot(lanes[lane], grad[place.out + lane]);
  return total;
}

/// Along columns. NDRange: one work-item per (image, output row, vector of pixels).
/// in   weights  float[tap]
/// in   in       float4[image][in_length][width]
/// out  out      float4[image][out_length][width]
kernel void blur_columns(const BlurPass p, global const float* restrict weights, global const float4* restrict in,
                         global float4* restrict out) {
  const uint i = (uint)get_global_id(0);
  if (i >= column_items(p)) return;
  const BlurPlace place = column_place(p, i);
  store_sums(column_sums(p, place, weights, in), place, out);
}

/// Along rows. NDRange: one work-item per (row, vector of output pixels).
/// in   weights  float[tap]
/// in   in       float4[row][in_length]
/// out  out      float4[row][out_length]
kernel void blur_rows(const BlurPass p, global const float* restrict weights, global const float4* restrict in,
                      global float4* restrict out) {
  const uint i = (uint)get_global_id(0);
  if (i >= row_items(p)) return;
  const BlurPlace place = row_place(p, i);
  store_sums(row_sums(p, place, weights, in), place, out);
}

/// What a pass adds to the derivative by the scale: its output, with the weights' derivative, times the gradient of the
/// output. NDRange as blur_columns.
/// in   weights  float[tap]  derivative
/// in   in, grad            as in and out of blur_columns
/// out  products  float      that of work-item i of image v: [v * stride + first + i]
kernel void blur_columns_scale(const BlurPass p, const uint stride, const uint first,
                               global const float* restrict weights, global const float4* restrict in,
                               global const float4* restrict grad, global float* restrict products) {
  const uint i = (uint)get_global_id(0);
  if (i >= column_items(p)) return;
  const uint items = p.out_length * vectors_of(p.width);
  const BlurPlace place = column_place(p, i);
  products[i / items * stride + first + i % items] =
      dot_sums(column_sums(p, place, weights, in), place, grad);
}

/// The same along rows, of which each image has `rows`.
kernel void blur_rows_scale(const BlurPass p, const uint stride, const uint first, const uint rows,
                            global const float* restrict weights, global const float4* restrict in,
                            global const float4* restrict grad, global float* restrict products) {
  const uint i = (uint)get_global_id(0);
  if (i >= row_items(p)) return;
  const uint items = rows * vectors_of(p.out_length);
  const BlurPlace place = row_place(p, i);
  products[i / items * stride + first + i % items] = dot_sums(row_sums(p, place, weights, in), place, grad);
}
