// What kernels of textures share, of base colours and of opacities: gradients by way of places and levels of
// detail, and lists of the texels that fragments see.
#ifndef DPR_SURFACE_TEXELS_H
#define DPR_SURFACE_TEXELS_H

#include "planes.h"
#include "texture.h"

/// Gradients of a level of detail's barycentrics, relative to corner 0's, and of the corners' places, q_k and
/// depths, from that of the place's step, which is the sum of c_k' place_k. Depths change q_k too:
/// depths_by_steps().
typedef struct {
  float bary1, bary2;
  float3 along;  // of place_k by the gradient of the step: c_k'
  float3 q, depth;
} DetailGradient;

static inline DetailGradient detail_backward(const TexturedFace* f, const Detail d, float c1, float c2,
                                             float2 grad_step) {
  const float along1 = dot(grad_step, f->place1), along2 = dot(grad_step, f->place2);
  // Not by ?:, which would choose between two places and so put them into memory.
  const float3 q = select(f->steps.q_x, f->steps.q_y, (int3)(-d.along_y));
  const float sum_q = q.x + q.y + q.z;
  const float3 depth = f->steps.depth, c = (float3)(1.0f - c1 - c2, c1, c2);
  const float mean = c1 * along1 + c2 * along2;
  const float by_depth = along1 * q.y + along2 * q.z - mean * sum_q;
  DetailGradient g;
  g.bary1 = (depth.y - depth.x) * by_depth - d.depth * along1 * sum_q;
  g.bary2 = (depth.z - depth.x) * by_depth - d.depth * along2 * sum_q;
  g.along = d.depth * (q - c * sum_q);
  g.along.x = -(g.along.y + g.along.z);
  g.q = d.depth * ((float3)(0.0f, along1, along2) - mean);
  g.depth = c * by_depth;
  return g;
}

/// Gradients of depths from those of q_k along x and y: on the screen q_k is divided by the depth z_k. A
/// clipped face has q_k of its homogeneous corners, without depths.
static inline float3 depths_by_steps(const TexturedFace* f, float3 grad_x, float3 grad_y) {
  if (f->is_clipped) return 0.0f;
  return -(grad_x * f->steps.q_x + grad_y * f->steps.q_y) / f->steps.depth;
}

/// The gradients of base colours, which are those of colours where no light falls on them.
static inline uint base_plane(const FrameParams p) {
  return (p.has_base ? DPR_GRAD_PLANE_BASE : DPR_PLANE_COLOR) * p.grad_fragments;
}

/// Sums over a pair's fragments of the gradients of its corners' places, and of what levels of detail depend on:
/// q_k along x, along y, and depths.
typedef struct {
  float2 place[3];
  float3 steps[3];
} PlaceSums;

/// Adds a fragment's, by the gradients of its place and of its level of detail, and those of the barycentrics of
/// corners 1 and 2 to `along1` and `along2`.
static inline void add_fragment(const TexturedFace* f, const Detail d, float c1, float c2, float2 grad_place,
                                float grad_detail, PlaceSums* sums, float* along1, float* along2) {
  *along1 += dot(grad_place, f->place1);
  *along2 += dot(grad_place, f->place2);
  if (d.varies) {
    const float2 grad_step = grad_detail * d.by_step;
    const DetailGradient g = detail_backward(f, d, c1, c2, grad_step);
    *along1 += g.bary1;
    *along2 += g.bary2;
    sums->place[0] += g.along.x * grad_step;
    sums->place[1] += g.along.y * grad_step;
    sums->place[2] += g.along.z * grad_step;
    sums->steps[0] += d.along_y ? (float3)(0.0f) : g.q;
    sums->steps[1] += d.along_y ? g.q : (float3)(0.0f);
    sums->steps[2] += g.depth;
  }
  sums->place[0] += (1.0f - c1 - c2) * grad_place;
  sums->place[1] += c1 * grad_place;
  sums->place[2] += c2 * grad_place;
}

/// After the last fragment.
static inline void finish_steps(const TexturedFace* f, PlaceSums* sums) {
  if (f->texture.levels > 1) sums->steps[2] += depths_by_steps(f, sums->steps[0], sums->steps[1]);
}

/// u, v of corner `k`, and 0.
static inline float3 place_gradient(const PlaceSums sums, size_t k) {
  return (float3)(sums.place[k].x, -sums.place[k].y, 0.0f);
}

/// Lists a fragment's texels: a cell, which is a texel and its neighbours to the right and below, and the parts of
/// these. `grad`: of what the texture is there.
static inline void list_fragment(const FrameParams p, const TexturedFace* f, const Detail d, uint i, float c1,
                                 float c2, float3 grad, global uint* cells, global SeenTexels* seen) {
  const Footprint footprint = find_footprint(f->texture, (uint)d.level, place_at(f, c1, c2));
  const uint2 cell = footprint_cells(footprint);
  for (uint k = 0; k < p.levels; ++k) {
    const uint place = p.levels * i + k;
    const int is_seen = f->is_textured && k < f->texture.levels;
    const float3 of_level = (k == 0 ? 1.0f - d.part : d.part) * grad;
    const float2 part = k == 0 ? footprint.part.xy : footprint.part.zw;
    cells[place] = !is_seen ? p.texels : k == 0 ? cell.x : cell.y;
    seen[place].red = of_level.x;
    seen[place].green = of_level.y;
    seen[place].blue = of_level.z;
    seen[place].right = part.x;
    seen[place].below = part.y;
  }
}

/// Derivatives of base colours with respect to their levels of detail, behind the last direction's tangents.
static inline global float* details_of(const FrameParams p, const TangentParams q, global float* tangents) {
  return tangents + (size_t)q.directions * q.planes * p.grad_fragments;
}

#endif
