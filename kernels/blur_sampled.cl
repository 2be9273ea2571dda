// The blur of the rigid image by samples of the noise of the pixel's position: I(x) = 1/M sum_m R(x + k_m).
// Every sample is a rigid frame, shifted by a draw k_m that all pixels of a view share. Draws are whole
// samples of the raster, so each of these frames is the raster, shifted. The two axes draw by themselves,
// from the weights of the exact blur: image and gradients are unbiased estimates of the exact ones.
//
// The raster's gradient is the transpose: the derivative of the shifted frames. That by the scale is a score
// estimate with the baselines of noise.h, of y_m = <dL/dI(x), R(x + k_m)> with d ln (probability of k_m) /
// ds.
#include "noise.h"

/// The first place whose cumulative probability reaches `u`.
static inline uint place_of(float u, uint last, global const float* restrict cumulative) {
  uint low = 0, high = last;
  while (low < high) {
    const uint middle = (low + high) / 2;
    if (u <= cumulative[middle]) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  return low;
}

/// Draws the shifts. One work-item per (view, block of samples). Deterministic.
/// in   cumulative, scores  float[2 * radius + 1]  see ShiftTable
/// out  shifts        uint2[view][sample]  along columns' and rows' numbers, plus the radius
/// out  shift_scores  float[view][sample]  both axes'
kernel void blur_sampled_draw(const ShiftParams p, global const float* restrict cumulative,
                              global const float* restrict scores, global uint2* restrict shifts,
                              global float* restrict shift_scores) {
  const uint blocks = (p.sampling.samples + DPR_WIDTH - 1) / DPR_WIDTH, i = (uint)get_global_id(0);
  if (i >= p.views * blocks) return;
  const uint view = i / blocks, block = i % blocks;
  float u[2][DPR_WIDTH];
  for (uint axis = 0; axis < 2; ++axis) {
    const NoiseName name = name_noise(p.first_view + view, 0, axis, DPR_STAGE_OCCUPANCY);
    store_n(draw_uniform(p.sampling, name, block), 0, u[axis]);
  }
  for (uint lane = 0; lane < DPR_WIDTH && DPR_WIDTH * block + lane < p.sampling.samples; ++lane) {
    const uint sample = view * p.sampling.samples + DPR_WIDTH * block + lane;
    const uint2 shift = (uint2)(place_of(u[0][lane], 2 * p.radius, cumulative),
                                place_of(u[1][lane], 2 * p.radius, cumulative));
    shifts[sample] = shift;
    shift_scores[sample] = scores[shift.x] + scores[shift.y];
  }
}

/// A pixel of an image, and where the frames that are shifted least have it on the raster.
typedef struct {
  uint view, stride;  // samples of a row
  size_t corner;      // the first of its samples in the frame that is shifted by -radius
} ShiftedPixel;

static inline ShiftedPixel shifted_pixel(const ShiftParams p, uint pixel) {
  const uint x = pixel % p.width, row = pixel / p.width, y = row % p.height;
  const uint origin = p.margin - p.radius, height = p.height * p.supersampling + 2 * p.margin;
  ShiftedPixel at;
  at.view = row / p.height;
  at.stride = p.width * p.supersampling + 2 * p.margin;
  at.corner =
      ((size_t)at.view * height + origin + y * p.supersampling) * at.stride + origin + x * p.supersampling;
  return at;
}

/// The pixel in a shifted frame: the mean of its samples.
static inline float4 shifted_value(const ShiftParams p, const ShiftedPixel at, uint2 shift,
                                   global const float4* restrict raster) {
  global const float4* samples = raster + at.corner + (size_t)shift.y * at.stride + shift.x;
  float4 sum = 0.0f;
  for (uint row = 0; row < p.supersampling; ++row) {
    for (uint column = 0; column < p.supersampling; ++column)
      sum += samples[(size_t)row * at.stride + column];
  }
  return sum / (float)(p.supersampling * p.supersampling);
}

/// The mean of the shifted frames. One work-item per pixel. Deterministic.
/// in   shifts  uint2[view][sample]
/// in   raster  float4[view][height * supersampling + 2 * margin][width * supersampling + 2 * margin]
/// out  image   float4[view][height][width]
kernel void blur_sampled_forward(const ShiftParams p, global const uint2* restrict shifts,
                                 global const float4* restrict raster, global float4* restrict image) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= p.views * p.height * p.width) return;
  const ShiftedPixel at = shifted_pixel(p, pixel);
  float4 sum = 0.0f;
  for (uint m = 0; m < p.sampling.samples; ++m)
    sum += shifted_value(p, at, shifts[at.view * p.sampling.samples + m], raster);
  image[pixel] = sum / (float)p.sampling.samples;
}

/// The transpose of the forward pass. One work-item per sample of the raster. Deterministic. Inputs and
/// outputs as blur_sampled_forward has them:
/// in   shifts, grad_image
/// out  grad_raster
kernel void blur_sampled_backward(const ShiftParams p, global const uint2* restrict shifts,
                                  global const float4* restrict grad_image,
                                  global float4* restrict grad_raster) {
  const uint stride = p.width * p.supersampling + 2 * p.margin;
  const uint rows = p.height * p.supersampling + 2 * p.margin, i = (uint)get_global_id(0);
  if (i >= p.views * rows * stride) return;
  const uint view = i / stride / rows, origin = p.margin - p.radius;
  const uint2 at = (uint2)(i % stride, i / stride % rows) - origin;
  float4 sum = 0.0f;
  for (uint m = 0; m < p.sampling.samples; ++m) {
    // The difference of a sample before the frame wraps around, and so lies beyond the frame.
    const uint2 pixel = (at - shifts[view * p.sampling.samples + m]) / p.supersampling;
    if (pixel.x < p.width && pixel.y < p.height)
      sum += grad_image[(view * p.height + pixel.y) * p.width + pixel.x];
  }
  grad_raster[i] = sum / (float)(p.sampling.samples * p.supersampling * p.supersampling);
}

/// A pixel's share of the derivative by the scale. One work-item per pixel. Deterministic. Inputs as
/// blur_sampled_draw leaves them, blur_sampled_forward and blur_sampled_backward have them, and
/// in   shift_scores  float[view][sample]
/// in   raster, grad_image
/// out  products      float[view][height][width]
kernel void blur_sampled_scale(const ShiftParams p, global const uint2* restrict shifts,
                               global const float* restrict shift_scores,
                               global const float4* restrict raster, global const float4* restrict grad_image,
                               global float* restrict products) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= p.views * p.height * p.width) return;
  const ShiftedPixel at = shifted_pixel(p, pixel);
  const Sampling s = p.sampling;
  const float4 grad = grad_image[pixel], rigid = shifted_value(p, at, (uint2)(p.radius), raster);
  float by_score = 0.0f, score_sum = 0.0f, y_sum = 0.0f;
  for (uint m = 0; m < s.samples; ++m) {
    const uint sample = at.view * s.samples + m;
    const float y = dot(grad, shifted_value(p, at, shifts[sample], raster) - s.baseline * rigid);
    const float score = shift_scores[sample];
    // sum of (y + G / (M - g)) score, by the groups of the scores instead of those of the y.
    const float group = s.draws == DPR_ANTITHETIC ? score + shift_scores[sample ^ 1u] : score;
    by_score += y * (score + s.leave_out * group);
    score_sum += score;
    y_sum += y;
  }
  products[pixel] = score_estimate(s, by_score, score_sum, y_sum);
}
