// Fragment colours without lights: the corners' colours, interpolated. A face colour is three equal corners.
#include "shared_types.h"
#include "tile_lanes.h"

/// One work-item per pair, up to `last_pair`.
/// in   face_colors  uint4[face]         indices into colors, by corner
/// in   colors       float4[color] or, with a stride, float4[view][color]  linear RGB; w unused
/// in   bary1, bary2 float[fragment]     barycentrics of corners 1 and 2
/// out  red, green, blue  float[fragment]
kernel void shade_forward(const FrameParams p, const uint last_pair, global const uint* restrict pair_face,
                          global const uint* restrict fragment_starts, global const uint4* restrict face_colors,
                          global const float4* restrict colors, global const float* restrict bary1,
                          global const float* restrict bary2, global float* restrict red,
                          global float* restrict green, global float* restrict blue) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= last_pair) return;
  const uint view = pair_face[pair] / p.faces;
  const uint4 corners = face_colors[pair_face[pair] - view * p.faces] + view * p.color_stride;
  const float4 base = colors[corners.x], along1 = colors[corners.y] - base, along2 = colors[corners.z] - base;
  for (uint i = fragment_starts[pair]; i < fragment_starts[pair + 1]; i += DPR_WIDTH) {
    const realn c1 = load_n(i, bary1), c2 = load_n(i, bary2);
    store_n(base.x + c1 * along1.x + c2 * along2.x, i, red);
    store_n(base.y + c1 * along1.y + c2 * along2.y, i, green);
    store_n(base.z + c1 * along1.z + c2 * along2.z, i, blue);
  }
}

/// One work-item per pair, up to `last_pair`.
/// in   grad_red, grad_green, grad_blue  float[fragment]
/// out  grad_bary1, grad_bary2  float[fragment]  relative to corner 0's
/// out  grad_colors             float[pair][9]   RGB of the corners' colours, summed over the pair's fragments
kernel void shade_backward(const FrameParams p, const uint last_pair, global const uint* restrict pair_face,
                           global const uint2* restrict masks, global const uint* restrict fragment_starts,
                           global const uint4* restrict face_colors, global const float4* restrict colors,
                           global const float* restrict bary1, global const float* restrict bary2,
                           global const float* restrict grad_red, global const float* restrict grad_green,
                           global const float* restrict grad_blue, global float* restrict grad_bary1,
                           global float* restrict grad_bary2, global float* restrict grad_colors) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= last_pair) return;
  const uint view = pair_face[pair] / p.faces;
  const uint4 corners = face_colors[pair_face[pair] - view * p.faces] + view * p.color_stride;
  const float4 base = colors[corners.x], along1 = colors[corners.y] - base, along2 = colors[corners.z] - base;
  const uint first = fragment_starts[pair];
  const uint last = end_of_fragments(first, masks[pair]);
  realn sum[9];
#pragma unroll
  for (int k = 0; k < 9; ++k) sum[k] = 0.0f;
  for (uint i = first; i < last; i += DPR_WIDTH) {
    const realn r = load_gradient(i, last, grad_red);
    const realn g = load_gradient(i, last, grad_green);
    const realn b = load_gradient(i, last, grad_blue);
    const realn c1 = load_n(i, bary1), c2 = load_n(i, bary2), c0 = 1.0f - c1 - c2;
    store_n(r * along1.x + g * along1.y + b * along1.z, i, grad_bary1);
    store_n(r * along2.x + g * along2.y + b * along2.z, i, grad_bary2);
    sum[0] += c0 * r;
    sum[1] += c0 * g;
    sum[2] += c0 * b;
    sum[3] += c1 * r;
    sum[4] += c1 * g;
    sum[5] += c1 * b;
    sum[6] += c2 * r;
    sum[7] += c2 * g;
    sum[8] += c2 * b;
  }
#pragma unroll
  for (int k = 0; k < 9; ++k) grad_colors[9 * pair + k] = sum_lanes(sum[k]);
}
