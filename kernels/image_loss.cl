// Losses between images and targets, and their gradients: the weighted sum of those in image_losses.h. The
// pixels' sums are reduced by reduce.cl in between.
#include "image_losses.h"

/// What every pixel adds to the sums of its view. One work-item per pixel.
/// in   pixels         of all views
/// in   image, target  float4[view][pixel]  RGBA
/// out  channels       float[DPR_LOSS_SUMS][view][pixel]
kernel void image_loss_forward(const uint pixels, global const float4* restrict image,
                               global const float4* restrict target, global float* restrict channels) {
  const uint i = (uint)get_global_id(0);
  if (i >= pixels) return;
  float sums[DPR_LOSS_SUMS];
#define DPR_ADD_PIXEL(name) name##_add(image[i], target[i], sums + name##_first);
  DPR_IMAGE_LOSSES(DPR_ADD_PIXEL)
#pragma unroll
  for (uint k = 0; k < DPR_LOSS_SUMS; ++k) channels[k * pixels + i] = sums[k];
}

/// d loss / d image of the mean over the views. One work-item per pixel.
/// in   views, pixels_per_view
/// in   image, target  float4[view][pixel]  RGBA
/// in   sums           float[DPR_LOSS_SUMS][view]
/// in   weights        float[view][DPR_LOSS_COUNT]
/// out  grad_image     float4[view][pixel]
kernel void image_loss_backward(const uint views, const uint pixels_per_view,
                                global const float4* restrict image, global const float4* restrict target,
                                global const float* restrict sums, global const float* restrict weights,
                                global float4* restrict grad_image) {
  const uint i = (uint)get_global_id(0);
  if (i >= views * pixels_per_view) return;
  const uint view = i / pixels_per_view;
  float of_view[DPR_LOSS_SUMS];
#pragma unroll
  for (uint k = 0; k < DPR_LOSS_SUMS; ++k) of_view[k] = sums[k * views + view];
  global const float* weight = weights + view * DPR_LOSS_COUNT;
  float4 grad = 0.0f;
#define DPR_ADD_GRADIENT(name)     \
  if (weight[name##_number] != 0.0f) \
    grad += name##_gradient(weight[name##_number], image[i], target[i], of_view + name##_first);
  DPR_IMAGE_LOSSES(DPR_ADD_GRADIENT)
  const float mean = 1.0f / (3.0f * (float)pixels_per_view);
  grad_image[i] = (float4)(mean * grad.xyz, grad.w) / (float)views;
}
