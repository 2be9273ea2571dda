// Fragment colours without lights: the corners' colours, interpolated. A face colour is three equal corners.
#include "shared_types.h"
#include "tile_lanes.h"

/// A triangle's colours: c1, c2 of the way along `along1`, `along2` from `base`.
typedef struct {
  float4 base, along1, along2;
} CornerColors;

static inline CornerColors load_colors(const FrameParams p, uint view_face,
                                       global const uint4* restrict face_colors,
                                       global const float4* restrict colors) {
  const uint view = view_face / p.faces;
  const uint4 corners = face_colors[view_face - view * p.faces] + view * p.color_stride;
  CornerColors c;
  c.base = colors[corners.x];
  c.along1 = colors[corners.y] - c.base;
  c.along2 = colors[corners.z] - c.base;
  return c;
}

/// One work-item per group of pairs in `range`. Deterministic.
/// in   pair_face        uint[pair]      view * faces + face
/// in   fragment_starts  uint[pair + 1]  runs of fragments
/// in   face_colors  uint4[face]         indices into colors, by corner
/// in   colors       float4[color] or, with a stride, float4[view][color]  linear RGB; w unused
/// in   bary1, bary2 float[fragment]     barycentrics of corners 1 and 2
/// out  red, green, blue  float[fragment]
kernel void shade_forward(const FrameParams p, const uint2 range, global const uint* restrict pairs,
                          global const uint* restrict pair_face, global const uint* restrict fragment_starts,
                          global const uint4* restrict face_colors, global const float4* restrict colors,
                          global const float* restrict bary1, global const float* restrict bary2,
                          global float* restrict red, global float* restrict green,
                          global float* restrict blue) {
  const uint2 group = pair_group(range, pairs[0]);
  if (group.x >= group.y) return;
  const uint end = fragment_starts[group.y];
  for (uint pair = group.x; pair < group.y; ++pair) {
    const uint first = fragment_starts[pair], last = fragment_starts[pair + 1];
    if (first == last) continue;
    const CornerColors c = load_colors(p, pair_face[pair], face_colors, colors);
    for (uint i = first; i < last; i += DPR_WIDTH) {
      const realn c1 = load_n(i, bary1), c2 = load_n(i, bary2);
      store_run(c.base.x + c1 * c.along1.x + c2 * c.along2.x, i, end, red);
      store_run(c.base.y + c1 * c.along1.y + c2 * c.along2.y, i, end, green);
      store_run(c.base.z + c1 * c.along1.z + c2 * c.along2.z, i, end, blue);
    }
  }
}

/// One work-item per group of pairs in `range`. Deterministic. Inputs as shade_forward, and
/// in   grad_red, grad_green, grad_blue  float[fragment]
/// out  grad_bary1, grad_bary2  float[fragment]  relative to corner 0's
/// out  grad_colors             float[pair][9]   RGB of the corners' colours, summed over the pair's
///      fragments
kernel void shade_backward(const FrameParams p, const uint2 range, global const uint* restrict pairs,
                           global const uint* restrict pair_face, global const uint* restrict fragment_starts,
                           global const uint4* restrict face_colors, global const float4* restrict colors,
                           global const float* restrict bary1, global const float* restrict bary2,
                           global const float* restrict grad_red, global const float* restrict grad_green,
                           global const float* restrict grad_blue, global float* restrict grad_bary1,
                           global float* restrict grad_bary2, global float* restrict grad_colors) {
  const uint2 group = pair_group(range, pairs[0]);
  if (group.x >= group.y) return;
  const uint end = fragment_starts[group.y];
  for (uint pair = group.x; pair < group.y; ++pair) {
    const uint first = fragment_starts[pair], last = fragment_starts[pair + 1];
    if (first == last) {
      for (int k = 0; k < 9; ++k) grad_colors[9 * pair + k] = 0.0f;
      continue;
    }
    const CornerColors c = load_colors(p, pair_face[pair], face_colors, colors);
    realn sum[9];
#pragma unroll
    for (int k = 0; k < 9; ++k) sum[k] = 0.0f;
    for (uint i = first; i < last; i += DPR_WIDTH) {
      const intn in_run = lanes_before(last, i);
      const realn r = load_run(in_run, i, grad_red), g = load_run(in_run, i, grad_green);
      const realn b = load_run(in_run, i, grad_blue);
      const realn c1 = load_run(in_run, i, bary1), c2 = load_run(in_run, i, bary2), c0 = 1.0f - c1 - c2;
      store_run(r * c.along1.x + g * c.along1.y + b * c.along1.z, i, end, grad_bary1);
      store_run(r * c.along2.x + g * c.along2.y + b * c.along2.z, i, end, grad_bary2);
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
}
