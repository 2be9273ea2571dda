// What is left of a clipped face as samples see it: a triangle, or a quadrilateral of two.
#ifndef DPR_CLIPPED_VIEW_H
#define DPR_CLIPPED_VIEW_H

#include "clip.h"

#include "affine.h"
#include "rasterize.h"

/// The two triangles of what is left of a face; of a triangle the first alone.
typedef struct {
  Triangle triangle[2];
  int has_second;
} ClippedTriangles;

static inline ClippedTriangles load_clipped(const Triangle first, const ClippedFace c) {
  ClippedTriangles t;
  t.triangle[0] = first;
  t.has_second = c.corners == 4;
  t.triangle[1] = first;
  if (t.has_second) {
    t.triangle[1].x1 = first.x2;
    t.triangle[1].y1 = first.y2;
    t.triangle[1].z1 = first.z2;
    t.triangle[1].x2 = c.cut[1].x;
    t.triangle[1].y2 = c.cut[1].y;
    t.triangle[1].z2 = c.cut[1].z;
  }
  return t;
}

/// The corners of the visible part, in order.
typedef struct {
  float3 corner[4];  // x, y in NDC, depth; the last is that of a triangle's first
} Outline;

/// From the first corner that is kept, and the one after it.
static inline Outline outline_of(const ClippedFace c, float3 first, float3 next) {
  Outline o;
  o.corner[0] = first;
  o.corner[1] = c.corners == 4 ? next : c.cut[0].xyz;
  o.corner[2] = c.corners == 4 ? c.cut[0].xyz : c.cut[1].xyz;
  o.corner[3] = c.corners == 4 ? c.cut[1].xyz : o.corner[0];
  return o;
}

/// The edge of each of a quadrilateral's triangles that is its diagonal.
#define DPR_FIRST_DIAGONAL 1
#define DPR_SECOND_DIAGONAL 2

/// The squared distance to the edges of a triangle, but for one.
static inline realn outline_distance2(const View3 v, int left_out) {
  realn least = INFINITY;
#pragma unroll
  for (int k = 0; k < 3; ++k) least = lesser(least, k == left_out ? INFINITY : edge_distance2(v.edge[k]));
  return least;
}

/// Negative at the samples whose barycentrics are those of the second triangle: on its side of the diagonal.
/// A sliver has no barycentrics, and the other triangle reaches where it would.
static inline realn side_of_diagonal(const ClippedTriangles t, const Edge diagonal) {
  if (!t.has_second) return 1.0f;
  const realn side = diagonal.side * t.triangle[0].orientation;
  return is_sliver(t.triangle[0]) ? (realn)(-1.0f) : is_sliver(t.triangle[1]) ? (realn)(1.0f) : side;
}

/// A clipped face seen from samples.
typedef struct {
  View3 first, second;
  realn distance2;     // to the outline
  intn nearer_second;  // by an edge of the second triangle
} ViewedClip;

static inline ViewedClip view_clipped(const ClippedTriangles t, realn x, realn y) {
  ViewedClip v;
  v.first = v.second = view_triangle(t.triangle[0], x, y);
  v.distance2 = triangle_distance2(v.first);
  v.nearer_second = 0;
  if (!t.has_second) return v;
  v.second = view_triangle(t.triangle[1], x, y);
  const realn to_first = outline_distance2(v.first, DPR_FIRST_DIAGONAL);
  const realn to_second = outline_distance2(v.second, DPR_SECOND_DIAGONAL);
  v.nearer_second = to_second < to_first;
  v.distance2 = lesser(to_first, to_second);
  return v;
}

/// The barycentrics of an outline's corners in the whole face.
typedef struct {
  float of[4][3];
} OutlineWeights;

/// Weight of a face's corner in corner `k` of the outline, which is a kept corner or a cut.
static inline float weight_of(const ClippedFace c, uint k, uint corner) {
  const uint kept = c.corners - 2;
  if (k < kept) return corner == (c.first + k) % 3 ? 1.0f : 0.0f;
  if (k == c.corners) return 0.0f;
  const float part = clipped_cut(c, k - kept).w;
  return corner == lost_corner(c, k - kept) ? part : corner == kept_corner(c, k - kept) ? 1.0f - part : 0.0f;
}

static inline OutlineWeights weights_of(const ClippedFace c) {
  OutlineWeights w;
#pragma unroll
  for (uint k = 0; k < 4; ++k) {
#pragma unroll
    for (uint corner = 0; corner < 3; ++corner) w.of[k][corner] = weight_of(c, k, corner);
  }
  return w;
}

/// The clipped barycentrics of a sample in its triangle, by the outline's corners.
static inline void outline_barycentrics(const ViewedClip v, intn in_second, const BarycentricScale first,
                                        const BarycentricScale second, realn u[4]) {
  realn n[3], m[3];
  raw_barycentrics(v.first, first, n);
  raw_barycentrics(v.second, second, m);
  const realn of_first = inverse_of_clipped(n), of_second = inverse_of_clipped(m);
  const realn n1 = greater(n[1], 0.0f) * of_first, n2 = greater(n[2], 0.0f) * of_first;
  const realn m1 = greater(m[1], 0.0f) * of_second, m2 = greater(m[2], 0.0f) * of_second;
  u[0] = choose(in_second, 1.0f - m1 - m2, 1.0f - n1 - n2);
  u[1] = choose(in_second, (realn)(0.0f), n1);
  u[2] = choose(in_second, m1, n2);
  u[3] = choose(in_second, m2, (realn)(0.0f));
}

/// A pair's fragments, [first, last).
typedef struct {
  uint first, last;
  global const uint* pixels;
} ClippedRun;

/// The samples of the vector of fragments at `i`.
static inline void load_samples(const FrameParams p, const ClippedRun run, intn in_run, uint i, realn* x,
                                realn* y) {
  const uintn packed = load_pixels(in_run, i, run.pixels);
  *x = pixel_x(p, convert_realn(packed & 0xffffu));
  *y = pixel_y(p, convert_realn(packed >> 16));
}

#endif
