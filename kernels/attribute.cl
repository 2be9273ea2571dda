// Images of attributes (include/dpr/attribute_images.hpp): their alpha in the barrier composition, and what a
// loss compares of them.
#include "shared_types.h"

/// Puts the sum of the faces' weights into alpha: the red of a group of images that shows 1. One work-item
/// per pixel of the groups.
/// in   groups, pixels  the pixels of all views
/// in   rendered  float4[groups + 1][pixel]  the last group's red is the sum of the weights
/// out  images    float4[groups][pixel]
kernel void attribute_weigh_forward(const uint groups, const uint pixels,
                                    global const float4* restrict rendered, global float4* restrict images) {
  const uint i = (uint)get_global_id(0);
  if (i >= groups * pixels) return;
  images[i] = (float4)(rendered[i].xyz, rendered[groups * pixels + i % pixels].x);
}

/// One work-item per pixel of one group.
/// in   groups, pixels  as attribute_weigh_forward
/// in   grad_images    float4[groups][pixel]
/// out  grad_rendered  float4[groups + 1][pixel]
kernel void attribute_weigh_backward(const uint groups, const uint pixels,
                                     global const float4* restrict grad_images,
                                     global float4* restrict grad_rendered) {
  const uint i = (uint)get_global_id(0);
  if (i >= pixels) return;
  float grad_weight = 0.0f;
  for (uint group = 0; group < groups; ++group) {
    const float4 grad = grad_images[group * pixels + i];
    grad_rendered[group * pixels + i] = (float4)(grad.xyz, 0.0f);
    grad_weight += grad.w;
  }
  grad_rendered[groups * pixels + i] = (float4)(grad_weight, 0.0f, 0.0f, 0.0f);
}

/// What faces show beyond a target: sum_j w_j (a_j - target) = RGB - A target. One work-item per pixel.
/// in   pixels    of all views
/// in   images    float4[pixel]  RGB, and A, the sum of the weights
/// in   target    float4[pixel]
/// out  residual  float4[pixel]  w = 0
kernel void attribute_residual_forward(const uint pixels, global const float4* restrict images,
                                       global const float4* restrict target,
                                       global float4* restrict residual) {
  const uint i = (uint)get_global_id(0);
  if (i >= pixels) return;
  residual[i] = (float4)(images[i].xyz - images[i].w * target[i].xyz, 0.0f);
}

/// One work-item per pixel.
/// in   pixels, target  as attribute_residual_forward
/// in   grad_residual  float4[pixel]
/// out  grad_images    float4[pixel]
kernel void attribute_residual_backward(const uint pixels, global const float4* restrict target,
                                        global const float4* restrict grad_residual,
                                        global float4* restrict grad_images) {
  const uint i = (uint)get_global_id(0);
  if (i >= pixels) return;
  const float3 grad = grad_residual[i].xyz;
  grad_images[i] = (float4)(grad, -dot(grad, target[i].xyz));
}
