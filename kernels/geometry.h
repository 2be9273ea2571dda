// A pixel against a triangle: edge functions, signed squared distance, barycentrics. On lanes of pixels. Loops over the
// three corners are unrolled: an index that varies would put the vectors into memory.
#ifndef DPR_GEOMETRY_H
#define DPR_GEOMETRY_H

#include "shared_types.h"
#include "tile_lanes.h"

/// NDC of a pixel's centre. Columns count to the right, rows down; NDC y is up.
static inline realn pixel_x(const FrameParams p, realn column) {
  return (column + 0.5f - 0.5f * (float)p.width) * p.pixel_size;
}
static inline realn pixel_y(const FrameParams p, realn row) {
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

/// A triangle seen from pixels; edge k is opposite to vertex k, and its edge function is that vertex' barycentric times
/// the doubled area.
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

static inline intn inside_triangle(const View3 v, float orientation) {
  return v.edge[0].side * orientation > 0.0f && v.edge[1].side * orientation > 0.0f &&
         v.edge[2].side * orientation > 0.0f;
}

/// Where along the edge its closest point lies, in [0, 1].
static inline realn closest_on_edge(const Edge e) {
  return clamp((e.dx * e.ex + e.dy * e.ey) * e.inverse_length2, 0.0f, 1.0f);
}

/// From the edge's closest point to the pixel. Beside the edge it follows from the edge function, which keeps its
/// digits where subtracting two far points would not.
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
  return min(min(edge_distance2(v.edge[0]), edge_distance2(v.edge[1])), edge_distance2(v.edge[2]));
}

/// The unnormalised barycentrics n_i: edge functions, times the other two depths if perspective correct (a common
/// factor drops out later). Beyond the triangle's horizon, where its plane passes the camera, their sum is negative and
/// all signs turn. Returns the factor of the edge functions, +-`scale`; `scale` is 1 / doubled area, signed, which keeps
/// the numbers in range.
static inline realn raw_barycentrics(const View3 v, const Triangle t, float scale, uint perspective, realn n[3]) {
  n[0] = v.edge[0].side * scale * (perspective ? t.z1 * t.z2 : 1.0f);
  n[1] = v.edge[1].side * scale * (perspective ? t.z2 * t.z0 : 1.0f);
  n[2] = v.edge[2].side * scale * (perspective ? t.z0 * t.z1 : 1.0f);
  const realn turn = choose(n[0] + n[1] + n[2] < 0.0f, (realn)(-1.0f), (realn)(1.0f));
#pragma unroll
  for (int k = 0; k < 3; ++k) n[k] *= turn;
  return turn * scale;
}

static inline float inverse_area(const Triangle t) {
  return 1.0f / ((t.x1 - t.x0) * (t.y2 - t.y0) - (t.y1 - t.y0) * (t.x2 - t.x0));
}

#endif
