// Losses between images and targets, and their gradients: mean squared error (19), mean absolute error (76), silhouette
// IoU (75). Pixel sums are reduced by reduce.cl in between.
#include "shared_types.h"

/// What every pixel adds to the sums of its view. One work-item per pixel.
/// in   image, target  float4[view][pixel]
/// out  channels       float[DPR_LOSS_SUMS][view][pixel]
kernel void loss_forward(const LossParams p, global const float4* restrict image, global const float4* restrict target,
                         global float* restrict channels) {
  const uint i = (uint)get_global_id(0);
  const uint count = p.views * p.pixels_per_view;
  if (i >= count) return;
  const float3 difference = image[i].xyz - target[i].xyz;
  const float a = image[i].w, b = target[i].w;
  channels[i] = dot(difference, difference);
  channels[count + i] = fabs(difference.x) + fabs(difference.y) + fabs(difference.z);
  channels[2 * count + i] = a * b;
  channels[3 * count + i] = a + b - a * b;
}

/// d loss / d image of the mean over the views. One work-item per pixel.
/// in   sums         float[DPR_LOSS_SUMS][view]
/// in   silhouettes  float[view]  weight of the silhouette loss
/// out  grad_image   float4[view][pixel]
kernel void loss_backward(const LossParams p, global const float4* restrict image,
                          global const float4* restrict target, global const float* restrict sums,
                          global const float* restrict silhouettes, global float4* restrict grad_image) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.pixels_per_view) return;
  const uint view = i / p.pixels_per_view;
  const float3 difference = image[i].xyz - target[i].xyz;
  const float mean = 1.0f / (3.0f * (float)p.pixels_per_view);
  const float3 sign3 = (float3)(sign(difference.x), sign(difference.y), sign(difference.z));
  const float3 color = mean * (2.0f * p.mse * difference + p.l1 * sign3);
  const float intersection = sums[2 * p.views + view], united = sums[3 * p.views + view];
  // Where both images are empty they agree: no loss, no gradient.
  const float b = target[i].w;
  const float iou = united > 0.0f ? intersection / united : 1.0f;
  const float alpha = united > 0.0f ? -silhouettes[view] * (b - iou * (1.0f - b)) / united : 0.0f;
  grad_image[i] = (float4)(color, alpha) / (float)p.views;
}
