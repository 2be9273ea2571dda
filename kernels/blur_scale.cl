// The derivative of a blur by its scale: its passes with the weights' derivative, times the gradient.
#include "blur.h"

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
  float4 product = 0.0f;
  for (int x = 0; x < place.count; x += DPR_BLUR_PIXELS) {
    pixels_n sums[DPR_BLUR_BLOCK];
    fill_sums((pixels_n)(0.0f), sums);
    if (p.has_sums) {
      load_sums(p, place, x, in, sums);
    } else {
      add_columns(p, place, x, block_taps(p, place.at, DPR_BLUR_BLOCK), weights, in, sums);
    }
#pragma unroll
    for (int row = 0; row < DPR_BLUR_BLOCK; ++row) {
      if (row >= place.steps) break;
      float4 lanes[DPR_BLUR_PIXELS];
      store_lanes(sums[row], lanes);
      product += product_of_pixels(lanes, grad + (place.out + (size_t)x) + (size_t)row * p.width,
                                   place.count - x, DPR_BLUR_PIXELS);
    }
  }
  *to = sum_of_channels(product);
}

/// The sums of a block of pixels of a row, its first the place's `k`-th, times their gradients.
static inline float4 row_product(const BlurPass p, const BlurPlace place, int k,
                                 global const float* restrict weights, global const float4* restrict in,
                                 global const float4* restrict grad) {
  const int steps = place.steps - k;
  pixels_n sums[DPR_BLUR_ROW_BLOCK];
  row_sums(p, place.at + k, steps, weights, in + place.in, sums);
  return product_of_pixels((const float4*)sums, grad + (place.out + (size_t)k), steps, DPR_BLUR_ROW);
}

/// The same along rows, of which each image has `rows`: as blur_columns_scale, with the NDRange of blur_rows.
/// It asks no extents: with them NVIDIA's registers would not hold the sums.
kernel void blur_rows_scale(const BlurPass p, const uint stride, const uint first, const uint rows,
                            global const float* restrict weights, global const float4* restrict in,
                            global const float4* restrict grad, global float* restrict products) {
  const uint i = (uint)get_global_id(0), items = rows * row_items_per_line(p);
  if (i >= p.lines * row_items_per_line(p)) return;
  const BlurPlace place = row_place(p, i);
  // The first before the loop: a GPU has no other, and holds its sums in registers where there is no loop.
  float4 product = row_product(p, place, 0, weights, in, grad);
  for (int k = DPR_BLUR_ROW; k < DPR_BLUR_ROW_LENGTH && k < place.steps; k += DPR_BLUR_ROW)
    product += row_product(p, place, k, weights, in, grad);
  products[i / items * stride + first + i % items] = sum_of_channels(product);
}
