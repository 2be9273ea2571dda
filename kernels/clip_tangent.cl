// Tangents of the fragments of faces that cross the near plane, by way of the cuts that they get there: those
// of clip.cl, forward.
#include "clipped_view.h"

/// The tangents of an outline's corners, x, y (NDC) and depth, and of the cuts' parts.
typedef struct {
  float3 corner[4];
  float part[2];
} OutlineTangents;

static inline OutlineTangents outline_tangents(const FrameParams p, global const ViewParams* view,
                                               const ClippedFace c, global const uint4* face,
                                               global const float4* ndc, global const float4* clip,
                                               global const ViewTangent* by) {
  float3 cut[2];
#pragma unroll
  for (uint k = 0; k < 2; ++k)
    cut[k] = cut_tangent(p, view, c, k, clip[corner_in(face, kept_corner(c, k))].xyz,
                         clip[corner_in(face, lost_corner(c, k))].xyz, by);
  const Outline o =
      outline_of(c, ndc[corner_in(face, c.first)].xyz, ndc[corner_in(face, (c.first + 1) % 3)].xyz);
  const float3 first = (float3)(cut[0].xy, 0.0f), second = (float3)(cut[1].xy, 0.0f);
  const int is_quad = c.corners == 4;
  const OutlineTangents t = {
      {o.corner[0], is_quad ? o.corner[1] : first, is_quad ? first : second, is_quad ? second : o.corner[0]},
      {cut[0].z, cut[1].z}};
  return t;
}

/// The tangent of the barycentric of one of the face's corners in the outline's corner `k`.
static inline float weight_tangent(const ClippedFace c, const OutlineTangents t, uint k, uint corner) {
  const uint kept = c.corners - 2;
  if (k < kept || k >= c.corners) return 0.0f;
  const uint cut = k - kept;
  const float moved = cut == 0 ? t.part[0] : t.part[1];
  return corner == lost_corner(c, cut) ? moved : corner == kept_corner(c, cut) ? -moved : 0.0f;
}

/// Tangents of the fragments of clipped faces. One work-item per pair, up to p.last_pair. Deterministic. Inputs
/// as clip_backward and rasterize_tangent, and
/// in   view_tangents  ViewTangent[direction][view]
/// in   clip_vertices  float4[direction][view][vertex]  of homogeneous coordinates
/// in out  tangents    as rasterize_tangent leaves them; of clipped faces replaced
kernel void clip_tangent(const FrameParams p, const uint directions, const uint planes,
                         global const uint* restrict pairs, global const ViewParams* restrict views,
                         global const ClippedFace* restrict clipped,
                         global const Triangle* restrict triangles, global const uint* restrict pair_face,
                         global const uint* restrict fragment_starts, global const uint* restrict pixels,
                         global const uint4* restrict faces, global const ViewTangent* restrict view_tangents,
                         global const float4* restrict vertices, global const float4* restrict clip_vertices,
                         global const float* restrict fragments, global float* restrict tangents) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(p.last_pair, pairs[0])) return;
  const uint view_face = pair_face[pair], view = view_face / p.faces, last = fragment_starts[pair + 1];
  if (clipped[view_face].corners == 0 || fragment_starts[pair] == last) return;
  const ClippedFace c = clipped[view_face];
  const ClippedTriangles t = load_clipped(triangles[view_face], c);
  const BarycentricScale scale[2] = {barycentric_scale(t.triangle[0], p.perspective_correct),
                                     barycentric_scale(t.triangle[1], p.perspective_correct)};
  const OutlineWeights w = weights_of(c);
  const float z[4] = {t.triangle[0].z0, t.triangle[0].z1, t.triangle[0].z2, t.triangle[1].z2};
  const ClippedRun run = {fragment_starts[pair], last, pixels};
  const realn zero = 0.0f, one = 1.0f;
  for (uint i = run.first; i < last; i += DPR_WIDTH) {
    const intn in_run = lanes_before(last, i);
    realn x, y;
    load_samples(p, run, in_run, i, &x, &y);
    const ViewedClip v = view_clipped(t, x, y);
    const intn in_second = side_of_diagonal(t, v.first.edge[DPR_FIRST_DIAGONAL]) < 0.0f;
    CornerGradients by_distance[2] = {no_corner_gradients(), no_corner_gradients()};
    CornerGradients by_u[2][2];  // of either triangle, by corners 1 and 2
#pragma unroll
    for (int k = 0; k < 2; ++k) {
      by_u[k][0] = by_u[k][1] = no_corner_gradients();
      const View3 seen = k == 0 ? v.first : v.second;
      add_barycentric_gradient(seen, t.triangle[k], scale[k], zero, one, zero, &by_u[k][0]);
      add_barycentric_gradient(seen, t.triangle[k], scale[k], zero, zero, one, &by_u[k][1]);
    }
    if (!p.sharp) {
      const intn inside = as_intn(load_run(in_run, i, fragments + DPR_PLANE(p, DISTANCE))) >= 0;
      add_distance_gradient(v.first, t.has_second ? DPR_FIRST_DIAGONAL : DPR_NO_EDGE, inside, p.euclidean,
                            choose(v.nearer_second, zero, one), &by_distance[0]);
      add_distance_gradient(v.second, DPR_SECOND_DIAGONAL, inside, p.euclidean,
                            choose(v.nearer_second, one, zero), &by_distance[1]);
    }
    realn u[4];
    outline_barycentrics(v, in_second, scale[0], scale[1], u);
    for (uint d = 0; d < directions; ++d) {
      const size_t of_view = (size_t)(d * p.views + view);
      const OutlineTangents move = outline_tangents(
          p, views + view, c, faces + (view_face - view * p.faces), vertices + of_view * p.vertices,
          clip_vertices + of_view * p.vertices, view_tangents + of_view);
      const CornerTangents first = {{move.corner[0], move.corner[1], move.corner[2]}};
      const CornerTangents second = {{move.corner[0], move.corner[2], move.corner[3]}};
      const realn n1 = along_corners(by_u[0][0], first), n2 = along_corners(by_u[0][1], first);
      const realn m1 = along_corners(by_u[1][0], second), m2 = along_corners(by_u[1][1], second);
      const realn by[4] = {choose(in_second, -m1 - m2, -n1 - n2), choose(in_second, zero, n1),
                           choose(in_second, m1, n2), choose(in_second, m2, zero)};
      realn b1 = 0.0f, b2 = 0.0f, depth = 0.0f;
#pragma unroll
      for (uint k = 0; k < 4; ++k) {
        b1 += w.of[k][1] * by[k] + weight_tangent(c, move, k, 1) * u[k];
        b2 += w.of[k][2] * by[k] + weight_tangent(c, move, k, 2) * u[k];
        depth += by[k] * (z[k] - z[0]) + u[k] * move.corner[k].z;
      }
      global float* const out = tangents + (size_t)d * planes * p.grad_fragments;
      const uint bary = DPR_GRAD_PLANE(p, BARY);
      store_run(b1, i, last, out + bary);
      store_run(b2, i, last, out + bary + p.grad_fragments);
      store_run(depth, i, last, out + DPR_GRAD_PLANE(p, DEPTH));
      store_run(along_corners(by_distance[0], first) + along_corners(by_distance[1], second), i, last,
                out + DPR_GRAD_PLANE(p, LOG_OCCUPANCY));
    }
  }
}
