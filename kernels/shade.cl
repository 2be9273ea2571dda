// Fragment colours without lights: the corners' colours, interpolated. A face colour is three equal corners.
#include "face_rows.h"
#include "shared_types.h"
#include "tile_lanes.h"

/// A triangle's colours: c1, c2 of the way along `along1`, `along2` from `base`.
typedef struct {
  float4 base, along1, along2;
} CornerColors;

static inline CornerColors load_colors(const FrameParams p, uint view_face,
                                       global const uint4* restrict faces,
                                       global const float4* restrict colors) {
  const uint view = view_face / p.faces;
  const uint4 corners = faces[p.color_faces + row_of_face(p, view_face)] + view * p.color_stride;
  CornerColors c;
  c.base = colors[corners.x];
  c.along1 = colors[corners.y] - c.base;
  c.along2 = colors[corners.z] - c.base;
  return c;
}

/// One work-item per group of pairs in `range`. Deterministic.
/// in   pair_face        uint[pair]      view * faces + face
/// in   fragment_starts  uint[pair + 1]  runs of fragments
/// in   faces        uint4[...][face]    from p.color_faces on indices into colors, by corner
/// in   colors       float4[color] or, with a stride, float4[view][color]  linear RGB; w unused
/// in out  fragments  float[plane][fragment]  COLOR by BARY
kernel void shade_forward(const FrameParams p, const uint2 range, global const uint* restrict pairs,
                          global const uint* restrict pair_face, global const uint* restrict fragment_starts,
                          global const uint4* restrict faces, global const float4* restrict colors,
                          global float* restrict fragments) {
  const uint bary = DPR_PLANE(p, BARY);
  const uint2 group = pair_group(range, pairs[0]);
  if (group.x >= group.y) return;
  const uint end = fragment_starts[group.y];
  for (uint pair = group.x; pair < group.y; ++pair) {
    const uint first = fragment_starts[pair], last = fragment_starts[pair + 1];
    if (first == last) continue;
    const CornerColors c = load_colors(p, pair_face[pair], faces, colors);
    for (uint i = first; i < last; i += DPR_WIDTH) {
      const realn c1 = load_n(i + bary, fragments), c2 = load_n(i + bary + p.fragments, fragments);
      store_run3(c.base.x + c1 * c.along1.x + c2 * c.along2.x, c.base.y + c1 * c.along1.y + c2 * c.along2.y,
                 c.base.z + c1 * c.along1.z + c2 * c.along2.z, i, end, DPR_PLANE(p, COLOR), p.fragments,
                 fragments);
    }
  }
}

/// One work-item per group of pairs in `range`. Deterministic. Inputs as shade_forward, and
/// in out  grads        float[plane][fragment]  of BARY by those of COLOR
/// out     grad_colors  float[pair][9]          RGB of the corners' colours, summed over the pair's fragments
kernel void shade_backward(const FrameParams p, const uint2 range, global const uint* restrict pairs,
                           global const uint* restrict pair_face, global const uint* restrict fragment_starts,
                           global const uint4* restrict faces, global const float4* restrict colors,
                           global const float* restrict fragments, global float* restrict grads,
                           global float* restrict grad_colors) {
  global const float *const bary = fragments + DPR_PLANE(p, BARY),
                            *const grad_red = grads + DPR_GRAD_PLANE(p, COLOR),
                            *const grad_green = grad_red + p.grad_fragments;
  global float* const grad_bary = grads + DPR_GRAD_PLANE(p, BARY);
  const uint2 group = pair_group(range, pairs[0]);
  if (group.x >= group.y) return;
  const uint end = fragment_starts[group.y];
  for (uint pair = group.x; pair < group.y; ++pair) {
    const uint first = fragment_starts[pair], last = fragment_starts[pair + 1];
    if (first == last) {
      for (int k = 0; k < 9; ++k) grad_colors[9 * pair + k] = 0.0f;
      continue;
    }
    const CornerColors c = load_colors(p, pair_face[pair], faces, colors);
    realn sum[9];
#pragma unroll
    for (int k = 0; k < 9; ++k) sum[k] = 0.0f;
    for (uint i = first; i < last; i += DPR_WIDTH) {
      const intn in_run = lanes_before(last, i);
      const realn r = load_run(in_run, i, grad_red), g = load_run(in_run, i, grad_green);
      const realn b = load_run(in_run, i, grad_green + p.grad_fragments);
      const realn c1 = load_run(in_run, i, bary), c2 = load_run(in_run, i, bary + p.fragments);
      const realn c0 = 1.0f - c1 - c2;
      store_run(r * c.along1.x + g * c.along1.y + b * c.along1.z, i, end, grad_bary);
      store_run(r * c.along2.x + g * c.along2.y + b * c.along2.z, i, end, grad_bary + p.grad_fragments);
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

/// Tangents of colours by those of barycentrics and of the corners' colours. One work-item per group of pairs
/// in `range`. Deterministic. Inputs as shade_forward, and
/// in   color_tangents  float4[direction][color] or, with a stride, float4[direction][view][color]
/// in out  tangents     float[direction][q.planes][fragment]  COLOR by BARY
kernel void shade_tangent(const FrameParams p, const uint2 range, const TangentParams q,
                          global const uint* restrict pairs, global const uint* restrict pair_face,
                          global const uint* restrict fragment_starts, global const uint4* restrict faces,
                          global const float4* restrict colors, global const float4* restrict color_tangents,
                          global const float* restrict fragments, global float* restrict tangents) {
  const uint2 group = pair_group(range, pairs[0]);
  if (group.x >= group.y) return;
  const uint end = fragment_starts[group.y];
  for (uint pair = group.x; pair < group.y; ++pair) {
    const uint first = fragment_starts[pair], last = fragment_starts[pair + 1];
    if (first == last) continue;
    const CornerColors c = load_colors(p, pair_face[pair], faces, colors);
    for (uint d = 0; d < q.directions; ++d) {
      CornerColors m = {0.0f, 0.0f, 0.0f};
      if (q.colors != 0) m = load_colors(p, pair_face[pair], faces, color_tangents + (size_t)d * q.colors);
      global float* const of = tangents + (size_t)d * q.planes * p.grad_fragments;
      for (uint i = first; i < last; i += DPR_WIDTH) {
        const intn in_run = lanes_before(last, i);
        const realn b1 = load_run(in_run, i, of + DPR_GRAD_PLANE(p, BARY));
        const realn b2 = load_run(in_run, i, of + DPR_GRAD_PLANE(p, BARY) + p.grad_fragments);
        const realn c1 = load_run(in_run, i, fragments + DPR_PLANE(p, BARY));
        const realn c2 = load_run(in_run, i, fragments + DPR_PLANE(p, BARY) + p.fragments);
        const float4 a1 = c.along1, a2 = c.along2;
        store_run3(b1 * a1.x + b2 * a2.x + m.base.x + c1 * m.along1.x + c2 * m.along2.x,
                   b1 * a1.y + b2 * a2.y + m.base.y + c1 * m.along1.y + c2 * m.along2.y,
                   b1 * a1.z + b2 * a2.z + m.base.z + c1 * m.along1.z + c2 * m.along2.z, i, end,
                   DPR_GRAD_PLANE(p, COLOR), p.grad_fragments, of);
      }
    }
  }
}
