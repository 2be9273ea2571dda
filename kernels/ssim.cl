// Structural similarity of images and targets (Wang, Bovik, Sheikh, Simoncelli 2004), and its gradient. With
// the means mu, variances and covariance s of a window's pixels, weighed by a Gaussian,
//
//   S = (2 mu_x mu_y + C1) (2 s_xy + C2) / ((mu_x^2 + mu_y^2 + C1) (s_xx + s_yy + C2))
//
// by colour channel, with C1 = K1^2 and C2 = K2^2 of colours from 0 to 1. Windows lie in the image whole: one
// about every pixel that is DPR_SSIM_RADIUS or more from the border. The Gaussian is separable: moments are
// summed along rows, then along columns, and gradients go back along columns, then along rows.
//
// Moments are of colours relative to DPR_SSIM_MIDDLE, about which variances lose the fewest digits.
#include "image_losses.h"

#define DPR_SSIM_TAPS ((uint)(2 * DPR_SSIM_RADIUS + 1))

/// A Gaussian of standard deviation 1.5 at -5 to 5, its sum 1.
constant float ssim_weights[DPR_SSIM_TAPS] = {1.02838008e-3f, 7.59875810e-3f, 3.60007721e-2f, 1.09360689e-1f,
                                              2.13005537e-1f, 2.66011725e-1f, 2.13005537e-1f, 1.09360689e-1f,
                                              3.60007721e-2f, 7.59875810e-3f, 1.02838008e-3f};

#define DPR_SSIM_MIDDLE 0.5f
#define DPR_SSIM_C1 1e-4f /* K1 = 0.01 */
#define DPR_SSIM_C2 9e-4f /* K2 = 0.03 */

/// Position of a pixel in its image.
static inline uint2 place_of(uint pixel, uint width, uint height) {
  const uint in_view = pixel % (width * height);
  return (uint2)(in_view % width, in_view / width);
}

/// True if a window about that column or row is whole.
static inline int has_window(uint at, uint length) {
  return at >= DPR_SSIM_RADIUS && at + DPR_SSIM_RADIUS < length;
}

/// The first and second moments along rows: of x, y, x x, y y, x y. One work-item per pixel; nothing about
/// columns without a window. Deterministic.
/// in   width, height, pixels  of one view; of all views
/// in   image, target  float4[view][height][width]  RGBA
/// out  rows  float4[DPR_SSIM_MOMENTS][view][height][width]
kernel void ssim_rows(const uint width, const uint height, const uint pixels,
                      global const float4* restrict image, global const float4* restrict target,
                      global float4* restrict rows) {
  const uint i = (uint)get_global_id(0);
  if (i >= pixels) return;
  if (!has_window(place_of(i, width, height).x, width)) return;
  float4 sums[DPR_SSIM_MOMENTS];
#pragma unroll
  for (uint k = 0; k < DPR_SSIM_MOMENTS; ++k) sums[k] = 0.0f;
#pragma unroll
  for (uint tap = 0; tap < DPR_SSIM_TAPS; ++tap) {
    const uint at = i + tap - DPR_SSIM_RADIUS;
    const float w = ssim_weights[tap];
    const float4 x = image[at] - DPR_SSIM_MIDDLE, y = target[at] - DPR_SSIM_MIDDLE;
    sums[0] += w * x;
    sums[1] += w * y;
    sums[2] += w * x * x;
    sums[3] += w * y * y;
    sums[4] += w * x * y;
  }
#pragma unroll
  for (uint k = 0; k < DPR_SSIM_MOMENTS; ++k) rows[k * pixels + i] = sums[k];
}

/// The similarity of every window, and its derivatives by the moments of x. One work-item per pixel.
/// Deterministic. Sizes as ssim_rows, and
/// in   rows       as ssim_rows leaves them
/// in   window     float[view][height][width]  what a window and a channel count; they add up to 1 in a view
/// in   first      where `similarity` begins
/// out  similarity float[first + view][height][width]  of the channels, times what they count; 0 without a
///                                                     window
/// out  grad_moments  float4[DPR_SSIM_GRADIENTS][view][height][width]  of similarity, by the moments of x,
///      x x and x y; 0 without a window
kernel void ssim_columns(const uint width, const uint height, const uint pixels, const uint first,
                         global const float4* restrict rows, global const float* restrict window,
                         global float* restrict similarity, global float4* restrict grad_moments) {
  const uint i = (uint)get_global_id(0);
  if (i >= pixels) return;
  const uint2 place = place_of(i, width, height);
  float4 by_mean = 0.0f, by_square = 0.0f, by_product = 0.0f;
  float sum = 0.0f;
  if (has_window(place.x, width) && has_window(place.y, height)) {
    float4 moments[DPR_SSIM_MOMENTS];
#pragma unroll
    for (uint k = 0; k < DPR_SSIM_MOMENTS; ++k) {
      moments[k] = 0.0f;
#pragma unroll
      for (uint tap = 0; tap < DPR_SSIM_TAPS; ++tap)
        moments[k] += ssim_weights[tap] * rows[k * pixels + i + tap * width - DPR_SSIM_RADIUS * width];
    }
    const float4 mean_x = moments[0] + DPR_SSIM_MIDDLE, mean_y = moments[1] + DPR_SSIM_MIDDLE;
    const float4 variances = moments[2] + moments[3] - moments[0] * moments[0] - moments[1] * moments[1];
    const float4 covariance = moments[4] - moments[0] * moments[1];
    const float4 light = 2.0f * mean_x * mean_y + DPR_SSIM_C1, structure = 2.0f * covariance + DPR_SSIM_C2;
    const float4 all_light = mean_x * mean_x + mean_y * mean_y + DPR_SSIM_C1,
                 all_structure = variances + DPR_SSIM_C2;
    const float4 inverse = 1.0f / (all_light * all_structure), s = light * structure * inverse;
    const float counts = window[i];
    sum = counts * (s.x + s.y + s.z);
    by_square = -counts * s / all_structure;
    by_product = counts * 2.0f * light * inverse;
    // The variance is the second moment less the square of the mean, and the covariance alike.
    by_mean = counts * 2.0f * (mean_y * structure * inverse - mean_x * s / all_light) -
              2.0f * moments[0] * by_square - moments[1] * by_product;
  }
  similarity[first + i] = sum;
  grad_moments[i] = by_mean;
  grad_moments[pixels + i] = by_square;
  grad_moments[2 * pixels + i] = by_product;
}

/// From the windows to the rows' moments. One work-item per pixel. Deterministic. Sizes as ssim_rows, and
/// in   grad_moments  as ssim_columns leaves them
/// out  grad_rows     float4[DPR_SSIM_GRADIENTS][view][height][width]
kernel void ssim_columns_backward(const uint width, const uint height, const uint pixels,
                                  global const float4* restrict grad_moments,
                                  global float4* restrict grad_rows) {
  const uint i = (uint)get_global_id(0);
  if (i >= pixels) return;
  const uint row = place_of(i, width, height).y;
  const uint first = row < DPR_SSIM_RADIUS ? DPR_SSIM_RADIUS - row : 0;
  const uint last = min(DPR_SSIM_TAPS, height + DPR_SSIM_RADIUS - row);
#pragma unroll
  for (uint k = 0; k < DPR_SSIM_GRADIENTS; ++k) {
    float4 sum = 0.0f;
    for (uint tap = first; tap < last; ++tap)
      sum += ssim_weights[tap] * grad_moments[k * pixels + i + tap * width - DPR_SSIM_RADIUS * width];
    grad_rows[k * pixels + i] = sum;
  }
}

/// From the rows' moments to the image, to whose gradient this is added. One work-item per pixel.
/// Deterministic. Sizes as ssim_rows, and
/// in   weights    float[view]  what the similarity counts in the loss, which falls with it
/// in   image, target, grad_rows
/// in out  grad_image  float4[view][height][width]
kernel void ssim_rows_backward(const uint width, const uint height, const uint pixels,
                               global const float* restrict weights, global const float4* restrict image,
                               global const float4* restrict target, global const float4* restrict grad_rows,
                               global float4* restrict grad_image) {
  const uint i = (uint)get_global_id(0);
  if (i >= pixels) return;
  const uint column = place_of(i, width, height).x;
  const uint first = column < DPR_SSIM_RADIUS ? DPR_SSIM_RADIUS - column : 0;
  const uint last = min(DPR_SSIM_TAPS, width + DPR_SSIM_RADIUS - column);
  float4 sums[DPR_SSIM_GRADIENTS];
#pragma unroll
  for (uint k = 0; k < DPR_SSIM_GRADIENTS; ++k) {
    sums[k] = 0.0f;
    for (uint tap = first; tap < last; ++tap)
      sums[k] += ssim_weights[tap] * grad_rows[k * pixels + i + tap - DPR_SSIM_RADIUS];
  }
  const float4 x = image[i] - DPR_SSIM_MIDDLE, y = target[i] - DPR_SSIM_MIDDLE;
  const float4 grad = sums[0] + 2.0f * x * sums[1] + y * sums[2];
  grad_image[i] -= weights[i / (width * height)] * (float4)(grad.xyz, 0.0f);
}
