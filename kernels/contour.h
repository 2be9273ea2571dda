// Contours: the mesh edges at which a view's rigid image may jump. Shared by the stage that finds them and the one that
// blends samples across them.
#ifndef DPR_CONTOUR_H
#define DPR_CONTOUR_H

#include "geometry.h"

/// How a face looks from a view.
#define DPR_FACE_DROPPED 0
#define DPR_FACE_FRONT 1 /* its corners wind counter-clockwise in NDC */
#define DPR_FACE_BACK 2

/// What an edge is in a view. What a contour occludes lies behind it; a crease has surface on both sides.
#define DPR_NO_CONTOUR 0
#define DPR_OCCLUDES 1
#define DPR_CREASE 2

/// The number of a contour: 2 * (view * edges + edge), and 1 more for a crease.
static inline uint contour_number(uint view_edge, int kind) { return 2 * view_edge + (kind == DPR_CREASE ? 1 : 0); }

/// On which sides of an edge its faces lie: +1 to the left of first -> second end, -1 to the right, 0 where there is
/// none, or a dropped one.
typedef struct {
  int own, other;
} EdgeSides;

static inline int side_of_face(uint facing) { return facing == DPR_FACE_DROPPED ? 0 : facing == DPR_FACE_FRONT ? 1 : -1; }

static inline int has_other_face(uint4 edge) { return edge.w != DPR_NO_FACE; }
static inline uint own_face(uint4 edge) { return edge.z & ~DPR_EDGE_FLAG; }
static inline uint other_face(uint4 edge) { return edge.w & ~DPR_EDGE_FLAG; }

/// `facing` is the view's.
static inline EdgeSides edge_sides(uint4 edge, global const uint* facing) {
  EdgeSides s = {side_of_face(facing[own_face(edge)]), 0};
  if (has_other_face(edge)) {
    // Faces that wind alike go through their edge in opposite directions.
    const int along = edge.w & DPR_EDGE_FLAG ? 1 : -1;
    s.other = along * side_of_face(facing[other_face(edge)]);
  }
  return s;
}

/// The side on which the surface lies that a contour bounds; of a crease its own face.
static inline int inner_side(EdgeSides s) { return s.own != 0 ? s.own : s.other; }

/// The corner of a face that is neither of two vertices.
static inline uint corner_across(uint4 face, uint first, uint second) {
  const uint x_is_end = face.x == first || face.x == second, y_is_end = face.y == first || face.y == second;
  return !x_is_end ? face.x : !y_is_end ? face.y : face.z;
}

/// An edge on the raster, as the rows cross it or the columns.
typedef struct {
  float2 a, b;     // NDC
  int is_by_rows;
  int ascends;     // b is above a by rows, to the right of a by columns
  float inverse;   // of the edge's extent across the lines
  float slope;     // of its other coordinate by that across the lines
} RasterEdge;

static inline RasterEdge raster_edge(float2 a, float2 b, int is_by_rows) {
  RasterEdge e;
  e.a = a;
  e.b = b;
  e.is_by_rows = is_by_rows;
  const float2 d = b - a;
  const float across = is_by_rows ? d.y : d.x;
  e.ascends = across > 0.0f;
  e.inverse = across != 0.0f ? 1.0f / across : 0.0f;
  e.slope = (is_by_rows ? d.x : d.y) * e.inverse;
  return e;
}

/// The squared sine of an edge's angle to the rows below which the columns alone count it, and the width of the range in
/// which both do: slopes of 1/2 to 2.
#define DPR_FLATTEST_BY_ROWS 0.2f
#define DPR_RANGE_BY_ROWS 0.6f

static inline float range_by_rows(float2 d) {
  const float length2 = dot(d, d);
  return length2 > 0.0f ? clamp((d.y * d.y / length2 - DPR_FLATTEST_BY_ROWS) / DPR_RANGE_BY_ROWS, 0.0f, 1.0f) : 0.0f;
}

/// How much an edge counts by rows; by columns it counts the rest. A step function of the slope would leave out, or count
/// twice, up to half a cell where a smooth contour passes 45 degrees.
static inline float weight_by_rows(float2 d) {
  const float x = range_by_rows(d);
  return x * x * (3.0f - 2.0f * x);
}

/// Its gradient by d.
static inline float2 weight_by_rows_gradient(float2 d) {
  const float x = range_by_rows(d), length2 = dot(d, d);
  if (!(x > 0.0f && x < 1.0f)) return (float2)(0.0f);
  const float2 direction = d / length2;
  const float by_sine2 = 6.0f * x * (1.0f - x) / DPR_RANGE_BY_ROWS;
  return 2.0f * by_sine2 * direction.x * direction.y * (float2)(-d.y, d.x);
}

/// NDC to samples: the centre of column c or row r is at c or r.
static inline float2 to_samples(const FrameParams p, float2 ndc) {
  const float inverse = 1.0f / p.pixel_size;
  return (float2)(ndc.x * inverse + 0.5f * (float)p.width - 0.5f, 0.5f * (float)p.height - 0.5f - ndc.y * inverse);
}

#endif
