// Forward mode of clip.cl: tangents of the fragments of faces that cross the near plane, by way of their cuts.
#include "clipped_view.h"
#include "face_rows.h"

/// Tangents of an outline: x, y (NDC) and depth of its corners; the first two have those of the cuts' parts in w.
#define DPR_OUTLINE_CORNERS 4

/// Finds the tangents of the outlines of clipped faces. One work-item per (view, face).
/// in   views, clipped  as clip_fragments
/// in   faces           uint4[face]  vertex indices
/// in   view_tangents   ViewTangent[direction][view]
/// in   vertices        float4[direction][view][vertex]  of x, y (NDC) and view depth
/// in   clip_vertices   float4[direction][view][vertex]  of homogeneous coordinates
/// out  outlines        float4[direction][view][face][DPR_OUTLINE_CORNERS]  those of other faces are not written
kernel void clip_outline_tangent(
    const FrameParams p, const TangentParams q, global const ViewParams* restrict views,
    global const ClippedFace* restrict clipped, global const uint4* restrict faces,
    global const ViewTangent* restrict view_tangents, global const float4* restrict vertices,
    global const float4* restrict clip_vertices, global float4* restrict outlines) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.faces || clipped[i].corners == 0) return;
  const uint view = i / p.faces;
  const ClippedFace c = clipped[i];
  global const uint4* const face = faces + row_of_face(p, i);
  for (uint d = 0; d < q.directions; ++d) {
    const size_t of_view = (size_t)d * p.views + view;
    global const float4 *ndc = vertices + of_view * p.vertices, *clip = clip_vertices + of_view * p.vertices;
    float3 cut[2];
#pragma unroll
    for (uint k = 0; k < 2; ++k)
      cut[k] = cut_tangent(p, views + view, c, k, clip[corner_in(face, kept_corner(c, k))].xyz,
                           clip[corner_in(face, lost_corner(c, k))].xyz, view_tangents + of_view);
    const float4 kept = (float4)(ndc[corner_in(face, c.first)].xyz, cut[0].z);
    const float4 next = (float4)(ndc[corner_in(face, (c.first + 1) % 3)].xyz, cut[1].z);
    const float2 second = c.corners == 4 ? next.xy : cut[0].xy;
    const float2 third = c.corners == 4 ? cut[0].xy : cut[1].xy;
    global float4* const out = outlines + DPR_OUTLINE_CORNERS * ((size_t)d * p.views * p.faces + i);
    out[0] = kept;
    out[1] = (float4)(second, c.corners == 4 ? next.z : 0.0f, cut[1].z);
    out[2] = (float4)(third, 0.0f, 0.0f);
    out[3] = c.corners == 4 ? (float4)(cut[1].xy, 0.0f, 0.0f) : kept;
  }
}

/// The tangent of the barycentric of one of the face's corners in the outline's corner `k`.
static inline float weight_tangent(const ClippedFace c, float2 parts, uint k, uint corner) {
  const uint kept = c.corners - 2;
  if (k < kept || k >= c.corners) return 0.0f;
  const uint cut = k - kept;
  const float moved = cut == 0 ? parts.x : parts.y;
  return corner == lost_corner(c, cut) ? moved : corner == kept_corner(c, cut) ? -moved : 0.0f;
}

/// Where the tangents of a pair are read and written.
typedef struct {
  uint directions, planes, last;
  global const float4* outline;  // of the first direction
  global float* tangents;
} PairTangents;

/// Tangents of depths and barycentrics of a vector of fragments, at the samples in one of an outline's triangles: of
/// corners 0, 1 and 2, or of 0, 2 and 3.
static inline void inner_tangents(const FrameParams p, const ClippedFace c, const Triangle t, int is_second,
                                  const View3 v, intn is_in, uint i, const PairTangents at) {
  const realn zero = 0.0f, one = 1.0f;
  const BarycentricScale scale = barycentric_scale(t, p.perspective_correct);
  CornerGradients by_u1 = no_corner_gradients(), by_u2 = by_u1;
  add_barycentric_gradient(v, t, scale, zero, one, zero, &by_u1);
  add_barycentric_gradient(v, t, scale, zero, zero, one, &by_u2);
  realn n[3];
  raw_barycentrics(v, scale, n);
  const realn inverse = inverse_of_clipped(n);
  const realn u1 = greater(n[1], 0.0f) * inverse, u2 = greater(n[2], 0.0f) * inverse;
  const uint k = is_second ? 2 : 1;  // its corner 1 in the outline
  for (uint d = 0; d < at.directions; ++d) {
    global const float4* const move = at.outline + DPR_OUTLINE_CORNERS * (size_t)d * p.views * p.faces;
    const CornerTangents corners = {{move[0].xyz, move[k].xyz, move[k + 1].xyz}};
    const float2 parts = (float2)(move[0].w, move[1].w);
    const realn b1 = along_corners(by_u1, corners), b2 = along_corners(by_u2, corners);
    realn bary[2];
#pragma unroll
    for (uint corner = 1; corner < 3; ++corner) {
      bary[corner - 1] = (weight_of(c, k, corner) - weight_of(c, 0, corner)) * b1 +
                         (weight_of(c, k + 1, corner) - weight_of(c, 0, corner)) * b2 +
                         weight_tangent(c, parts, k, corner) * u1 +
                         weight_tangent(c, parts, k + 1, corner) * u2;
    }
    const realn depth = (1.0f - u1 - u2) * corners.corner[0].z + u1 * corners.corner[1].z +
                        u2 * corners.corner[2].z + b1 * (t.z1 - t.z0) + b2 * (t.z2 - t.z0);
    const realn values[3] = {depth, bary[0], bary[1]};
    global float* const out = at.tangents + (size_t)d * at.planes * p.grad_fragments;
    const uint plane[3] = {DPR_GRAD_PLANE(p, DEPTH), DPR_GRAD_PLANE(p, BARY),
                           DPR_GRAD_PLANE(p, BARY) + p.grad_fragments};
#pragma unroll
    for (int value = 0; value < 3; ++value) {
      const uint first = i + plane[value], last = at.last + plane[value];
      const realn before = is_second ? load_own_run(last, first, out) : zero;
      store_run(choose(is_in, values[value], before), first, last, out);
    }
  }
}

/// Tangents of distances to the outline.
static inline void outer_tangents(const FrameParams p, const ClippedTriangles t, const ViewedClip v,
                                  intn inside, uint i, const PairTangents at) {
  const realn zero = 0.0f, one = 1.0f;
  CornerGradients first = no_corner_gradients(), second = first;
  add_distance_gradient(v.first, t.has_second ? DPR_FIRST_DIAGONAL : DPR_NO_EDGE, inside, p.euclidean,
                        choose(v.nearer_second, zero, one), &first);
  add_distance_gradient(v.second, DPR_SECOND_DIAGONAL, inside, p.euclidean,
                        choose(v.nearer_second, one, zero), &second);
  for (uint d = 0; d < at.directions; ++d) {
    global const float4* const move = at.outline + DPR_OUTLINE_CORNERS * (size_t)d * p.views * p.faces;
    const CornerTangents of_first = {{move[0].xyz, move[1].xyz, move[2].xyz}};
    const CornerTangents of_second = {{move[0].xyz, move[2].xyz, move[3].xyz}};
    global float* const out =
        at.tangents + (size_t)d * at.planes * p.grad_fragments + DPR_GRAD_PLANE(p, LOG_OCCUPANCY);
    store_run(along_corners(first, of_first) + along_corners(second, of_second), i, at.last, out);
  }
}

/// Tangents of the fragments of clipped faces. One work-item per pair, up to p.last_pair. Deterministic. Inputs
/// as clip_fragments, and
/// in   fragments  float[plane][fragment]  DISTANCE
/// in   outlines   as clip_outline_tangent leaves them
/// in out  tangents  as rasterize_tangent leaves them; of clipped faces replaced
kernel void clip_tangent(const FrameParams p, const TangentParams q,
                         global const uint* restrict pairs, global const ClippedFace* restrict clipped,
                         global const Triangle* restrict triangles, global const uint* restrict pair_face,
                         global const uint* restrict fragment_starts, global const uint* restrict pixels,
                         global const float4* restrict outlines, global const float* restrict fragments,
                         global float* restrict tangents) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(p.last_pair, pairs[0])) return;
  const uint face = pair_face[pair], last = fragment_starts[pair + 1];
  if (clipped[face].corners == 0 || fragment_starts[pair] == last) return;
  const ClippedFace c = clipped[face];
  const ClippedTriangles t = load_clipped(triangles[face], c);
  const ClippedRun run = {fragment_starts[pair], last, pixels};
  const PairTangents at = {q.directions, q.planes, last, outlines + DPR_OUTLINE_CORNERS * (size_t)face, tangents};
  // One thing after the other: together they would need too many registers.
  for (uint i = run.first; !p.sharp && i < last; i += DPR_WIDTH) {
    const intn in_run = lanes_before(last, i);
    realn x, y;
    load_samples(p, run, in_run, i, &x, &y);
    const intn inside = as_intn(load_run(in_run, i, fragments + DPR_PLANE(p, DISTANCE))) >= 0;
    outer_tangents(p, t, view_clipped(t, x, y), inside, i, at);
  }
#pragma unroll
  for (int is_second = 0; is_second < 2; ++is_second) {
    if (is_second && !t.has_second) break;
    for (uint i = run.first; i < last; i += DPR_WIDTH) {
      realn x, y;
      load_samples(p, run, lanes_before(last, i), i, &x, &y);
      const intn in_second =
          side_of_diagonal(t, view_triangle(t.triangle[0], x, y).edge[DPR_FIRST_DIAGONAL]) < 0.0f;
      inner_tangents(p, c, t.triangle[is_second], is_second, view_triangle(t.triangle[is_second], x, y),
                     is_second ? in_second : !in_second, i, at);
    }
  }
}
