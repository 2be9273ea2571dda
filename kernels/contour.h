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

/// NDC to samples: the centre of column c or row r is at c or r.
static inline float2 to_samples(const FrameParams p, float2 ndc) {
  const float inverse = 1.0f / p.pixel_size;
  return (float2)(ndc.x * inverse + 0.5f * (float)p.width - 0.5f, 0.5f * (float)p.height - 0.5f - ndc.y * inverse);
}

#endif
