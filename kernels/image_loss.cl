// Losses between images and targets, and their gradients: the weighted sum of those in image_losses.h, of the
// images and, in a pyramid, of smaller versions of them. The pixels' sums are reduced by reduce.cl in
// between.
#include "image_losses.h"

#ifndef DPR_LANES
#define DPR_LANES 8 /* the device's width; the host chooses it */
#endif

/// Pixels of a work-item, one after the other: what they have in common is read once.
#if DPR_LANES == 1
#define DPR_PIXEL_RUN 1
#else
#define DPR_PIXEL_RUN 16
#endif

static inline LossPixel make_pixel(float4 image, float4 target, float inverse_scale_squared) {
  LossPixel p;
  p.image = image;
  p.target = target;
  p.inverse_scale_squared = inverse_scale_squared;
  return p;
}

/// True if a loss is one of the `used`; their sums lie one behind the other, in the order of the losses.
#define DPR_IS_USED(used, name) (((used) >> name##_number & 1u) != 0)

/// Sums of a view over the pixels. One work-item per run of pixels.
/// in   pixels         of all views
/// in   used           bit k: loss k counts
/// in   inverse_scale_squared  of the robust loss
/// in   image, target  float4[view][pixel]  RGBA
/// in   mask           float[view][pixel]   how much a pixel counts
/// out  channels       float[sum used][view][pixel]
kernel void image_loss_forward(const uint pixels, const uint used, const float inverse_scale_squared,
                               global const float4* restrict image, global const float4* restrict target,
                               global const float* restrict mask, global float* restrict channels) {
  const uint first = (uint)get_global_id(0) * DPR_PIXEL_RUN, last = min(first + DPR_PIXEL_RUN, pixels);
  for (uint i = first; i < last; ++i) {
    const LossPixel pixel = make_pixel(image[i], target[i], inverse_scale_squared);
    const float weight = mask[i];
    uint place = i;
#define DPR_ADD_PIXEL(name)                                                                     \
  if (DPR_IS_USED(used, name)) {                                                                \
    float sums[name##_sums];                                                                    \
    name##_add(pixel, sums);                                                                    \
    for (uint k = 0; k < name##_sums; ++k, place += pixels) channels[place] = weight * sums[k]; \
  }
    DPR_IMAGE_LOSSES(DPR_ADD_PIXEL)
  }
}

/// Values shared by the gradients of a view's pixels.
typedef struct {
  global const float *sums, *weights;
  uint views;
  float of_colors, of_alpha;  // what they are scaled by, but for the mask
} ViewGradient;

static inline float4 pixel_gradient(const ViewGradient v, const uint used, const LossPixel pixel) {
  uint place = 0;
  float4 grad = 0.0f;
#define DPR_ADD_GRADIENT(name)                                                                               \
  if (DPR_IS_USED(used, name)) {                                                                             \
    float of_view[name##_sums];                                                                              \
    for (uint k = 0; k < name##_sums; ++k, place += v.views) of_view[k] = v.sums[place];                     \
    if (v.weights[name##_number] != 0.0f) grad += name##_gradient(v.weights[name##_number], pixel, of_view); \
  }
  DPR_IMAGE_LOSSES(DPR_ADD_GRADIENT)
  return (float4)(v.of_colors * grad.xyz, v.of_alpha * grad.w);
}

/// d loss / d image of the mean over the views and levels. One work-item per run
/// of pixels.
/// in   views, pixels_per_view
/// in   images         that the mean is over: levels times views, which may be more than these
/// in   used, inverse_scale_squared, image, target, mask  as image_loss_forward
/// in   sums           float[sum used][view]
/// in   weights        float[view][DPR_LOSS_COUNT]
/// in   channels       float[view]  the sum of the mask times the colour channels
/// out  grad_image     float4[view][pixel]
kernel void image_loss_backward(const uint views, const uint pixels_per_view, const uint images,
                                const uint used, const float inverse_scale_squared,
                                global const float4* restrict image, global const float4* restrict target,
                                global const float* restrict mask, global const float* restrict sums,
                                global const float* restrict weights, global const float* restrict channels,
                                global float4* restrict grad_image) {
  const uint first = (uint)get_global_id(0) * DPR_PIXEL_RUN,
             last = min(first + DPR_PIXEL_RUN, views * pixels_per_view);
  for (uint i = first; i < last;) {
    const uint view = i / pixels_per_view, end = min(last, (view + 1) * pixels_per_view);
    const float of_alpha = 1.0f / (float)images;
    const ViewGradient v = {sums + view, weights + view * DPR_LOSS_COUNT, views, of_alpha / channels[view],
                            of_alpha};
    for (; i < end; ++i) {
      const LossPixel pixel = make_pixel(image[i], target[i], inverse_scale_squared);
      grad_image[i] = mask[i] * pixel_gradient(v, used, pixel);
    }
  }
}

/// A level of a pyramid from the one before: means of blocks of 2x2 pixels, at the border of those that are
/// there. One work-item per pixel of it.
/// in   width, height  of the level before
/// in   pixels         of all views, of this level
/// in   large          float4[view][height][width]  RGBA
/// out  small          float4[view][(height + 1) / 2][(width + 1) / 2]
kernel void image_loss_shrink(const uint width, const uint height, const uint pixels,
                              global const float4* restrict large, global float4* restrict small) {
  const uint i = (uint)get_global_id(0);
  if (i >= pixels) return;
  const uint small_width = (width + 1) / 2, small_height = (height + 1) / 2;
  const uint view = i / (small_width * small_height), place = i - view * small_width * small_height;
  const uint x = place % small_width * 2, y = place / small_width * 2;
  const uint columns = min(width - x, 2u), rows = min(height - y, 2u);
  float4 sum = 0.0f;
  for (uint k = 0; k < columns * rows; ++k)
    sum += large[(view * height + y + k / columns) * width + x + k % columns];
  small[i] = sum / (float)(columns * rows);
}

/// Adds the gradients of a level to those of the one before. One work-item per pixel of that.
/// in   width, height  of the level before
/// in   pixels         of all views, of that level
/// in   grad_small     float4[view][(height + 1) / 2][(width + 1) / 2]
/// in out  grad_large  float4[view][height][width]
kernel void image_loss_shrink_backward(const uint width, const uint height, const uint pixels,
                                       global const float4* restrict grad_small,
                                       global float4* restrict grad_large) {
  const uint i = (uint)get_global_id(0);
  if (i >= pixels) return;
  const uint small_width = (width + 1) / 2, small_height = (height + 1) / 2;
  const uint view = i / (width * height), place = i - view * width * height;
  const uint x = place % width / 2, y = place / width / 2;
  const uint block = min(width - 2 * x, 2u) * min(height - 2 * y, 2u);
  grad_large[i] += grad_small[(view * small_height + y) * small_width + x] / (float)block;
}
