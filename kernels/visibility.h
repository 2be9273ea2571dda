// Contours of a tile and their crossings' visibility: what the search for crossings, that for those that come
// second, and the way back from both have in common.
#ifndef DPR_VISIBILITY_H
#define DPR_VISIBILITY_H

#include "steps.h"

/// Depths that differ by less than this part of them are not told apart.
#define DPR_DEPTH_SLACK 1e-5f

/// Depths across a crease follow its faces up to this part of their change within a step.
#define DPR_CREASE_SLACK 0.5f

/// A contour of a tile.
typedef struct {
  float2 a, b;    // its ends, NDC
  float2 depths;  // of its ends
  uint4 record;
  uint view, flags;
} TileContour;

static inline TileContour load_contour(const FrameParams p, uint contour, global const uint2* restrict edges,
                                       global const uint4* restrict faces, global const float4* restrict ndc,
                                       global const ClippedFace* restrict clipped) {
  TileContour c;
  const uint numbered = contour / DPR_CONTOUR_FLAGS;
  c.flags = contour % DPR_CONTOUR_FLAGS;
  c.view = numbered / p.edges;
  const ViewEdge e =
      view_edge(edges_of_view(p, c.view, edges, faces, ndc, clipped), numbered - c.view * p.edges);
  c.record = e.record;
  c.a = e.end[0].xy;
  c.b = e.end[1].xy;
  c.depths = (float2)(e.end[0].z, e.end[1].z);
  return c;
}

/// Area that an edge's ends add to a crossing: none where they have no corners that count.
static inline CornerArea corner_of(const FrameParams p, const TileContour c, const RasterEdge e,
                                   const Crossing x, int is_second) {
  const CornerArea none = {0.0f, 0.0f, 0.0f, 0.0f};
  const uint flag = is_second ? DPR_CONTOUR_SECOND_END : DPR_CONTOUR_FIRST_END;
  return c.flags & flag ? corner_area(p, e, x, is_second ? e.b : e.a) : none;
}

/// Cut of a crossing.
static inline Cut cut_of(const FrameParams p, const TileContour c, const RasterEdge e, const Crossing x) {
  float area = x.t - 0.5f;
  // One end after the other, so that one is in the registers at a time.
#pragma unroll 1
  for (int end = 0; end < 2; ++end) area += corner_of(p, c, e, x, end).area;
  return (Cut)(area, fmin(e.slope * e.slope, DPR_SLOPE2_THAT_COUNTS));
}

/// True if the first sample of a step is on the contour's inner side.
static inline int first_is_inner(const TileContour c, const RasterEdge e) {
  return ((c.flags & DPR_CONTOUR_LEFT) != 0) == e.ascends;
}

static inline float mix_depths(const FrameParams p, float2 depths, float along) {
  return p.perspective_correct ? 1.0f / ((1.0f - along) / depths.x + along / depths.y)
                               : depths.x + along * (depths.y - depths.x);
}

/// The depth of a face's plane at a sample; that of the edge where the face is too thin to say, or does not
/// reach.
static inline float plane_depth(const FrameParams p, const TileContour c, float3 across, float2 sample,
                                float otherwise) {
  const float2 ab = c.b - c.a, ac = across.xy - c.a, as = sample - c.a;
  const float area = ab.x * ac.y - ab.y * ac.x;
  if (!(fabs(area) > DPR_SLIVER_AREA)) return otherwise;
  const float third = (ab.x * as.y - ab.y * as.x) / area, second = (as.x * ac.y - as.y * ac.x) / area;
  const float first = 1.0f - second - third;
  if (!p.perspective_correct) return first * c.depths.x + second * c.depths.y + third * across.z;
  const float inverse = first / c.depths.x + second / c.depths.y + third / across.z;
  return inverse > 0.0f ? 1.0f / inverse : otherwise;
}

/// True if something hides a crease from one of the step's samples: what lies nearer there than the face on
/// its side.
static inline int hides_crease(const FrameParams p, const TileContour c, global const uint4* restrict faces,
                               global const float4* restrict ndc, int own, float2 sample, float front,
                               float depth, float slack) {
  const uint4 face = faces[first_row(p, c.view) + (own ? own_face(c.record) : other_face(c.record))];
  const float3 across = corner_across(face, c.record, ndc + c.view * p.vertices);
  const float expected = plane_depth(p, c, across, sample, depth);
  return front < expected - slack - DPR_CREASE_SLACK * fabs(expected - depth);
}

/// The depth of the surface that a sample shows, at a crossing `distance` steps away, as the sample beyond
/// continues it; the sample's own if that is further.
static inline float depth_at_crossing(float front, float beyond, float distance) {
  const float continued = front + distance * (front - beyond);
  return continued > front && continued < INFINITY ? continued : front;
}

/// Inputs of the search for a tile's crossings.
typedef struct {
  global const uint4* faces;
  global const float4* ndc;
  global const float* front;
  uint first;   // place of the view's first sample in the window, modulo 2^32
  float reach;  // view depth behind the nearest that may still be seen
} CrossingScene;

/// From how many of the samples of the step that it crosses something hides a contour.
static inline int hidden_from(const FrameParams p, const CrossingScene v, const TileContour c,
                              const RasterEdge e, const Crossing x, int is_crease, float depth) {
  const uint to_next = e.is_by_rows ? 1 : p.width, first = v.first + (uint)x.row * p.width + (uint)x.column;
  const int inner_first = first_is_inner(c, e);
  const float slack = v.reach + DPR_DEPTH_SLACK * depth;
  if (is_crease) {
    const float2 here = pixel_centre(p, x.column, x.row);
    const float2 next = pixel_centre(p, x.column + e.is_by_rows, x.row + !e.is_by_rows);
    return hides_crease(p, c, v.faces, v.ndc, inner_first, here, v.front[first], depth, slack) +
           hides_crease(p, c, v.faces, v.ndc, !inner_first, next, v.front[first + to_next], depth, slack);
  }
  const uint outer = inner_first ? first + to_next : first, outwards = inner_first ? to_next : 0 - to_next;
  const int place = (e.is_by_rows ? x.column : x.row) + (inner_first ? 2 : -1);
  const int is_inside = place >= 0 && place < (int)(e.is_by_rows ? p.width : p.height);
  const float beyond = is_inside ? v.front[outer + outwards] : INFINITY;
  const float front = depth_at_crossing(v.front[outer], beyond, inner_first ? 1.0f - x.t : x.t);
  return front < depth - slack ? 2 : 0;
}

/// The place of a crossing's step in the planes of steps, of which each has `pixels`.
static inline uint step_of(const FrameParams p, uint view, const RasterEdge e, const Crossing x) {
  return (e.is_by_rows ? 0 : samples_of_window(p)) + place_of_sample(p, view, (uint)x.column, (uint)x.row);
}

/// The place of a contour's crossing of a step among the seconds of a list, which ascend by their contours;
/// DPR_NO_CROSSING where it is none of them.
static inline uint place_of_second(uint contour, uint step, uint list, global const uint* restrict counts,
                                   global const SecondCrossing* restrict seconds) {
  const uint last = DPR_SECOND_ROOM * list + counts[list];
  uint first = DPR_SECOND_ROOM * list;
  for (uint count = counts[list]; count > 0; count /= 2) {
    const uint middle = first + count / 2;
    if (seconds[middle].contour >= contour) continue;
    first = middle + 1;
    --count;
  }
  for (; first < last && seconds[first].contour == contour; ++first) {
    if (seconds[first].step == step) return first;
  }
  return DPR_NO_CROSSING;
}

/// Bytes that hold a bit for every step of a tile: one a row, for the steps along it, then one a column.
#define DPR_TILE_BYTES (2 * DPR_TILE)

/// The bit of a crossing's step among those along the lines of its tile in the same direction.
static inline uint bit_in_tile(const RasterEdge e, const Crossing x) {
  return (uint)(x.line % DPR_TILE) * DPR_TILE + (uint)(e.is_by_rows ? x.column : x.row) % DPR_TILE;
}

static inline int has_bit(global const uchar* bytes, const RasterEdge e, const Crossing x) {
  const uint bit = bit_in_tile(e, x);
  return bytes[(e.is_by_rows ? 0 : DPR_TILE) + bit / DPR_TILE] >> bit % DPR_TILE & 1;
}

#endif
