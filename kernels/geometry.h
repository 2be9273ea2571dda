// A pixel against a triangle: edge functions, signed squared distance, barycentrics. On lanes of pixels.
// Loops over the three corners are unrolled: an index that varies would put the vectors into memory.
#ifndef DPR_GEOMETRY_H
#define DPR_GEOMETRY_H

#include "shared_types.h"
#include "tile_lanes.h"
#include "tiles.h"

/// pixel_centre() of lanes.
static inline realn pixel_x(const FrameParams p, realn column) {
#pragma OPENCL FP_CONTRACT OFF
  return (column + 0.5f - 0.5f * (float)p.width) * p.pixel_size;
}
static inline realn pixel_y(const FrameParams p, realn row) {
#pragma OPENCL FP_CONTRACT OFF
  return (0.5f * (float)p.height - 0.5f - row) * p.pixel_size;
}

/// One edge a -> b seen from pixels: the pixel relative to a, and the edge function cross(b - a, pixel - a).
typedef struct {
  float ex, ey, inverse_length2;
  realn dx, dy, side;
} Edge;

static inline Edge make_edge(float ax, float ay, float bx, float by, realn x, realn y) {
  Edge e;
  e.ex = bx - ax;
  e.ey = by - ay;
  const float length2 = e.ex * e.ex + e.ey * e.ey;
  e.inverse_length2 = length2 > 0.0f ? 1.0f / length2 : 0.0f;
  e.dx = x - ax;
  e.dy = y - ay;
  e.side = e.ex * e.dy - e.ey * e.dx;
  return e;
}

/// A triangle seen from pixels; edge k is opposite to vertex k, and its edge function is that vertex'
/// barycentric times the doubled area.
typedef struct {
  Edge edge[3];
} View3;

static inline View3 view_triangle(const Triangle t, realn x, realn y) {
  View3 v;
  v.edge[0] = make_edge(t.x1, t.y1, t.x2, t.y2, x, y);
  v.edge[1] = make_edge(t.x2, t.y2, t.x0, t.y0, x, y);
  v.edge[2] = make_edge(t.x0, t.y0, t.x1, t.y1, x, y);
  return v;
}

/// The least of the edge functions, positive inside. Where it is not further from zero than `side_error` its
/// sign is not certain: owns_sample() knows.
static inline realn least_side(const View3 v, float orientation) {
  return lesser(lesser(v.edge[0].side * orientation, v.edge[1].side * orientation),
                v.edge[2].side * orientation);
}

/// A bound of the rounding error of a triangle's edge functions at the pixels of the image: five roundings of
/// 2^-24, and some room.
static inline float side_error(const FrameParams p, const Triangle t) {
  const float reach_x = 0.5f * (float)p.width * p.pixel_size + fmax(fmax(fabs(t.x0), fabs(t.x1)), fabs(t.x2));
  const float reach_y =
      0.5f * (float)p.height * p.pixel_size + fmax(fmax(fabs(t.y0), fabs(t.y1)), fabs(t.y2));
  const float along_x = fmax(fmax(fabs(t.x1 - t.x0), fabs(t.x2 - t.x1)), fabs(t.x0 - t.x2));
  const float along_y = fmax(fmax(fabs(t.y1 - t.y0), fabs(t.y2 - t.y1)), fabs(t.y0 - t.y2));
  return 0x1p-21f * (along_x * reach_y + along_y * reach_x) + DPR_EDGE_FLOOR;
}

/// Position of the edge's closest point along the edge, in [0, 1].
static inline realn closest_on_edge(const Edge e) {
  return clamp((e.dx * e.ex + e.dy * e.ey) * e.inverse_length2, 0.0f, 1.0f);
}

/// From the edge's closest point to the pixel. Beside the edge it follows from the edge function, which keeps
/// its digits where subtracting two far points would not.
static inline void offset_from_edge(const Edge e, realn along, realn* qx, realn* qy) {
  const intn beside = along > 0.0f && along < 1.0f;
  const realn s = e.side * e.inverse_length2;
  *qx = choose(beside, -s * e.ey, e.dx - along * e.ex);
  *qy = choose(beside, s * e.ex, e.dy - along * e.ey);
}

static inline realn edge_distance2(const Edge e) {
  realn qx, qy;
  offset_from_edge(e, closest_on_edge(e), &qx, &qy);
  return qx * qx + qy * qy;
}

static inline realn triangle_distance2(const View3 v) {
  return lesser(lesser(edge_distance2(v.edge[0]), edge_distance2(v.edge[1])), edge_distance2(v.edge[2]));
}

/// True if the triangle is nearer than the root of `limit`: a corner, or an edge that the sample is beside.
static inline intn is_within(const View3 v, float limit) {
  realn nearest = INFINITY;
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    const Edge e = v.edge[k];
    const realn along = (e.dx * e.ex + e.dy * e.ey) * e.inverse_length2;
    const intn is_beside = along > 0.0f && along < 1.0f;
    nearest = lesser(nearest, e.dx * e.dx + e.dy * e.dy);
    nearest = lesser(nearest, choose(is_beside, e.side * e.side * e.inverse_length2, (realn)(INFINITY)));
  }
  return nearest < limit;
}

static inline float doubled_area(const Triangle t) {
  return (t.x1 - t.x0) * (t.y2 - t.y0) - (t.y1 - t.y0) * (t.x2 - t.x0);
}

/// True if rounding has left nothing of the area. A sliver covers the samples that it owns, so that its
/// neighbours' meet; it is not blurred, and its barycentrics, all weight at vertex 0, have no gradient.
static inline int is_sliver(const Triangle t) { return !(fabs(doubled_area(t)) > DPR_SLIVER_AREA); }

/// Factors from a triangle's edge functions to barycentrics: 1 / doubled area, signed, and 1 / depth of each
/// vertex if perspective correct. Common factors drop out later: they keep the numbers in range, whatever the
/// unit of length and however thin the triangle. All zero for a sliver.
typedef struct {
  float factor[3], inverse_depth[3];
} BarycentricScale;

static inline BarycentricScale barycentric_scale(const Triangle t, uint perspective) {
  const float scale = is_sliver(t) ? 0.0f : t.orientation / fabs(doubled_area(t));
  const float z[3] = {t.z0, t.z1, t.z2};
  const float nearest = fmin(fmin(t.z0, t.z1), t.z2);
  BarycentricScale s;
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    s.inverse_depth[k] = perspective ? 1.0f / z[k] : 0.0f;
    s.factor[k] = perspective ? scale * (nearest / z[k]) : scale;
  }
  return s;
}

/// The unnormalised barycentrics n_i. Beyond the triangle's horizon, where its plane passes the camera, their
/// sum is negative and all signs turn. Returns that sign.
static inline realn raw_barycentrics(const View3 v, const BarycentricScale s, realn n[3]) {
#pragma unroll
  for (int k = 0; k < 3; ++k) n[k] = v.edge[k].side * s.factor[k];
  const realn turn = choose(n[0] + n[1] + n[2] < 0.0f, (realn)(-1.0f), (realn)(1.0f));
#pragma unroll
  for (int k = 0; k < 3; ++k) n[k] *= turn;
  return turn;
}

/// 1 / sum max(n_i, 0), or 0 where the sum is: then all weight is vertex 0's.
static inline realn inverse_of_clipped(const realn n[3]) {
  const realn sum = greater(n[0], 0.0f) + greater(n[1], 0.0f) + greater(n[2], 0.0f);
  return choose(sum > 0.0f, 1.0f / sum, (realn)(0.0f));
}

#endif
