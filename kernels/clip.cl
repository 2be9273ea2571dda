// Faces that cross the near plane, or the far plane alone. What is left of such a face is a triangle or a
// quadrilateral: one face still, with one distance, to its outline, and the barycentrics of the whole face, so that
// what comes after rasterization knows nothing of it. A quadrilateral is two triangles for coverage and barycentrics; by the
// rule of ownership the diagonal between them is no seam.
//
// These kernels follow those that treat every face as whole, and replace what they left of clipped ones.
// Gradients go by way of the cuts to the corners on both sides of the plane (clip.h).
#include "clipped_view.h"
#include "face_rows.h"
#include "setup.h"

/// A cut between a corner that is kept and one that is not. The same for all faces that share the two. Not
/// contracted, so that it is so in every lane.
static inline float4 make_cut(const FrameParams p, global const ViewParams* view, float3 kept, float3 lost,
                              float plane) {
#pragma OPENCL FP_CONTRACT OFF
  const float part = (kept.z - plane) / (kept.z - lost.z);
  const float2 at = bend_ndc(view, cut_ndc(p, kept, lost, part, plane));
  return (float4)(at.x, at.y, plane, part);
}

/// The orientation of the larger of its two triangles; 0 where there is no area, or it reaches beyond
/// DPR_MAX_NDC.
static inline int orientation_of_outline(const Outline o) {
  float2 reach = 0.0f;
  float sum = 0.0f;
#pragma unroll
  for (int k = 0; k < 4; ++k) {
    reach = fmax(reach, fabs(o.corner[k].xy));
    sum += o.corner[k].x + o.corner[k].y + o.corner[k].z;
  }
  // Written so that a NaN fails.
  if (!(fabs(sum) < INFINITY && fmax(reach.x, reach.y) < DPR_MAX_NDC)) return 0;
  const float2 a = o.corner[0].xy, b = o.corner[1].xy - a, c = o.corner[2].xy - a, d = o.corner[3].xy - a;
  const int is_second = fabs(c.x * d.y - c.y * d.x) > fabs(b.x * c.y - b.y * c.x);
  return side_of_line(a, is_second ? o.corner[2].xy : o.corner[1].xy,
                      is_second ? o.corner[3].xy : o.corner[2].xy);
}

/// A triangle of an outline's first corner and two more that follow each other.
static inline Triangle triangle_of(const Outline o, int second, float orientation, uint first_sample,
                                   uint last_sample) {
  const float3 a = o.corner[0], b = o.corner[second], c = o.corner[second + 1];
  const Triangle t = {a.x, a.y, b.x, b.y, c.x, c.y, a.z, b.z, c.z, orientation, first_sample, last_sample};
  return t;
}

/// Finds the faces that cross a plane, the near one or else the far one, and sets up what is left of them. All tiles of
/// the bounds are listed. One work-item per (view, face). Deterministic.
/// in      views     ViewParams[view]
/// in      faces     uint4[face]            vertex indices
/// in      world     float4[view][vertex]
/// in      ndc       float4[view][vertex]
/// out     clipped   ClippedFace[view][face]
/// in out  facing, kept, counts, triangles  as setup_forward leaves them, which drops these faces: what the
///                   raster sees of them is set up. Of a quadrilateral the triangle of the first three
///                   corners
kernel void clip_forward(const FrameParams p, global const ViewParams* restrict views,
                         global const uint4* restrict faces, global const float4* restrict world,
                         global const float4* restrict ndc, global ClippedFace* restrict clipped,
                         global uchar* restrict facing, global uchar* restrict kept,
                         global uint* restrict counts, global Triangle* restrict triangles) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.faces) return;
  const uint view = i / p.faces;
  global const uint4* const face = faces + row_of_face(p, i);
  const uint vertex[3] = {face->x, face->y, face->z};
  global const float4 *const view_ndc = ndc + view * p.vertices, *const view_world =
                                                                     world + view * p.vertices;
  const float znear = views[view].znear, zfar = views[view].zfar;
  const float4 projection = views[view].projection;
  clipped[i].corners = 0;
  uint nearer = 0, further = 0;
#pragma unroll
  for (uint k = 0; k < 3; ++k) {
    nearer |= view_ndc[vertex[k]].z < znear ? 1u << k : 0u;
    further |= view_ndc[vertex[k]].z > zfar ? 1u << k : 0u;
  }
  const uint lost = nearer != 0 ? nearer : further;
  const float plane = nearer != 0 ? znear : zfar;
  if (lost == 0 || lost == 7) return;
  ClippedFace c;
  const uint one = popcount(lost) == 1 ? lost : 7 - lost;  // the corner that is alone on its side
  c.corners = popcount(lost) == 1 ? 4 : 3;
  c.first = (one == 1 ? 0 : one == 2 ? 1 : 2) + (c.corners == 4 ? 1 : 0);
  c.first %= 3;
  c.unused = 0;
#pragma unroll
  for (uint k = 0; k < 3; ++k) {
    const float3 in_camera =
        apply_affine(views[view].row[0], views[view].row[1], views[view].row[2], view_world[vertex[k]].xyz);
    const float depth = view_ndc[vertex[k]].z, w = p.orthographic ? 1.0f : depth;
    const float2 homogeneous = in_camera.xy * projection.xy + projection.zw * w;
    c.corner[k] = (float4)(homogeneous.x, homogeneous.y, depth, w);
  }
#pragma unroll
  for (uint cut = 0; cut < 2; ++cut)
    c.cut[cut] = make_cut(p, views + view, clipped_corner(c, kept_corner(c, cut)).xyz,
                          clipped_corner(c, lost_corner(c, cut)).xyz, plane);
  const Outline o =
      outline_of(c, view_ndc[corner_in(face, c.first)].xyz, view_ndc[corner_in(face, (c.first + 1) % 3)].xyz);
  const int orientation = orientation_of_outline(o);
  if (orientation == 0 || (float)orientation == p.culled) return;
  c.orientation = (float)orientation;
  clipped[i] = c;
  facing[i] = facing_of(orientation);

  float2 lowest = o.corner[0].xy, highest = lowest;
#pragma unroll
  for (int k = 1; k < 4; ++k) {
    lowest = fmin(lowest, o.corner[k].xy);
    highest = fmax(highest, o.corner[k].xy);
  }
  const PixelBounds bounds = bounds_of(p, lowest, highest);
  if (!meets_image(p, bounds)) return;
  kept[i] = 1;
  const uint2 columns = samples_within(bounds.left, bounds.right, p.width);
  const uint2 rows = samples_within(bounds.top, bounds.bottom, p.height);
  const uint2 tiles =
      (uint2)(columns.y / DPR_TILE + 1 - columns.x / DPR_TILE, rows.y / DPR_TILE + 1 - rows.x / DPR_TILE);
  counts[i] = tiles.x * tiles.y;
  if (counts[i] == 0) return;
  triangles[i] = triangle_of(o, 1, c.orientation, columns.x | rows.x << 16, columns.y | rows.y << 16);
}

/// Adds what the second triangles of clipped faces cover to what the first do. One work-item for every pair
/// within the capacity.
/// in      pairs      uint[1]      how many there are
/// in      clipped    ClippedFace[view][face]
/// in      triangles, pair_face, pair_tile  as rasterize_cover
/// in out  masks, counts  as rasterize_cover leaves them
kernel void clip_cover(const FrameParams p, const uint capacity, global const uint* restrict pairs,
                       global const ClippedFace* restrict clipped, global const Triangle* restrict triangles,
                       global const uint* restrict pair_face, global const uint* restrict pair_tile,
                       global uint2* restrict masks, global uint* restrict counts) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= capacity || pair >= pairs[0]) return;
  const uint face = pair_face[pair];
  if (clipped[face].corners != 4) return;
  const ClippedTriangles t = load_clipped(triangles[face], clipped[face]);
  const uint2 mask = masks[pair] | cover_tile(p, t.triangle[1], pair_tile[pair]);
  masks[pair] = mask;
  counts[pair] = popcount(mask.x) + popcount(mask.y);
}

/// Distances, depths and barycentrics of the fragments of clipped faces. One work-item per pair, up to
/// `last_pair`. Deterministic.
/// in   clipped  as clip_cover
/// in   triangles, pair_face, fragment_starts  as rasterize_forward
/// in   pixels   uint[fragment]  x | y << 16
/// out  fragments  float[plane][fragment]  DISTANCE, DEPTH, BARY as rasterize_forward, of the whole face; not
///                 written for other faces
kernel void clip_fragments(const FrameParams p, const uint last_pair, global const uint* restrict pairs,
                           global const ClippedFace* restrict clipped,
                           global const Triangle* restrict triangles, global const uint* restrict pair_face,
                           global const uint* restrict fragment_starts, global const uint* restrict pixels,
                           global float* restrict fragments) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(last_pair, pairs[0])) return;
  const uint face = pair_face[pair], last = fragment_starts[pair + 1];
  if (clipped[face].corners == 0 || fragment_starts[pair] == last) return;
  const ClippedFace c = clipped[face];
  const ClippedTriangles t = load_clipped(triangles[face], c);
  const BarycentricScale first = barycentric_scale(t.triangle[0], p.perspective_correct);
  const BarycentricScale second = barycentric_scale(t.triangle[1], p.perspective_correct);
  const OutlineWeights w = weights_of(c);
  const float error[2] = {side_error(p, t.triangle[0]), side_error(p, t.triangle[1])};
  const float z[4] = {t.triangle[0].z0, t.triangle[0].z1, t.triangle[0].z2, t.triangle[1].z2};
  for (uint i = fragment_starts[pair]; i < last; i += DPR_WIDTH) {
    const uintn packed = load_pixels(lanes_before(last, i), i, pixels);
    const realn x = pixel_x(p, convert_realn(packed & 0xffffu)), y = pixel_y(p, convert_realn(packed >> 16));
    const ViewedClip v = view_clipped(t, x, y);
    if (!p.sharp) {
      intn inside = is_inside(p, t.triangle[0], v.first, error[0], packed);
      if (t.has_second) inside = inside || is_inside(p, t.triangle[1], v.second, error[1], packed);
      store_run(with_sign(p, v.distance2, inside), i, last, fragments + DPR_PLANE(p, DISTANCE));
    }
    realn u[4], b1 = 0.0f, b2 = 0.0f, d = z[0];
    const intn in_second = side_of_diagonal(t, v.first.edge[DPR_FIRST_DIAGONAL]) < 0.0f;
    outline_barycentrics(v, in_second, first, second, u);
    for (int k = 0; k < 4; ++k) {
      b1 += w.of[k][1] * u[k];
      b2 += w.of[k][2] * u[k];
      d += u[k] * (z[k] - z[0]);
    }
    global float* const bary = fragments + DPR_PLANE(p, BARY);
    store_run(b1, i, last, bary);
    store_run(b2, i, last, bary + p.fragments);
    store_run(d, i, last, fragments + DPR_PLANE(p, DEPTH));
  }
}

/// Sums over the fragments of a clipped face: gradients of the outline's corners, and of the cuts' parts
/// by the barycentrics.
typedef struct {
  float3 corner[4];
  float part[2];
} OutlineGradients;

/// The gradient of where a cut is seen.
static inline float2 gradient_of_outline_cut(const ClippedFace c, const OutlineGradients g, uint cut) {
  const int is_quad = c.corners == 4;
  return cut == 0 ? (is_quad ? g.corner[2].xy : g.corner[1].xy) : is_quad ? g.corner[3].xy : g.corner[2].xy;
}

/// From there to the face's own corners: of those that are kept in NDC, and of all by way of the cuts.
static inline void store_corners(const FrameParams p, global const ViewParams* view, const ClippedFace c,
                                 const OutlineGradients g, global float* restrict grad_corners,
                                 global float* restrict grad_clip) {
  const int is_quad = c.corners == 4;
  const float3 by_cut[2] = {cut_gradient(p, view, c, 0, gradient_of_outline_cut(c, g, 0), g.part[0]),
                            cut_gradient(p, view, c, 1, gradient_of_outline_cut(c, g, 1), g.part[1])};
#pragma unroll
  for (uint k = 0; k < 3; ++k) {
    const float3 none = 0.0f;
    const int is_second = is_quad && k == (c.first + 1) % 3;
    vstore3(k == c.first ? g.corner[0] : is_second ? g.corner[1] : none, k, grad_corners);
    float3 sum = 0.0f;
#pragma unroll
    for (uint cut = 0; cut < 2; ++cut) {
      const float part = c.cut[cut].w;
      if (k == kept_corner(c, cut)) sum += (1.0f - part) * by_cut[cut];
      if (k == lost_corner(c, cut)) sum += part * by_cut[cut];
    }
    vstore3(sum, k, grad_clip);
  }
}

/// Adds what comes by the distance to the outline.
static inline void add_outline_distances(const FrameParams p, const ClippedTriangles t, const ClippedRun run,
                                         global const float* distance, global const float* grad_distance,
                                         CornerGradients g[2]) {
  const realn zero = 0.0f;
  for (uint i = run.first; i < run.last; i += DPR_WIDTH) {
    const intn in_run = lanes_before(run.last, i);
    realn x, y;
    load_samples(p, run, in_run, i, &x, &y);
    const ViewedClip v = view_clipped(t, x, y);
    const intn inside = as_intn(load_run(in_run, i, distance)) >= 0;
    const realn grad = load_run(in_run, i, grad_distance);
    add_distance_gradient(v.first, t.has_second ? DPR_FIRST_DIAGONAL : DPR_NO_EDGE, inside, p.euclidean,
                          choose(v.nearer_second, zero, grad), &g[0]);
    add_distance_gradient(v.second, DPR_SECOND_DIAGONAL, inside, p.euclidean,
                          choose(v.nearer_second, grad, zero), &g[1]);
  }
}

/// Derivative with respect to a cut's part, from the gradients of barycentrics.
static inline realn between_corners(const ClippedFace c, uint cut, realn grad_bary1, realn grad_bary2) {
  const uint lost = lost_corner(c, cut), kept = kept_corner(c, cut);
  const realn zero = 0.0f;
  const realn of_lost = lost == 0 ? zero : lost == 1 ? grad_bary1 : grad_bary2;
  const realn of_kept = kept == 0 ? zero : kept == 1 ? grad_bary1 : grad_bary2;
  return of_lost - of_kept;
}

/// Adds what comes by depths and barycentrics of the samples in one of the triangles: in the first, of
/// corners 0, 1 and 2 of the outline, or the second, of 0, 2 and 3.
static inline void add_outline_barycentrics(const FrameParams p, const ClippedFace c,
                                            const ClippedTriangles t, int is_second, const ClippedRun run,
                                            global const float* grads, CornerGradients* g, realn part[2]) {
  global const float* const grad_bary = grads + DPR_GRAD_PLANE(p, BARY);
  const Triangle triangle = t.triangle[is_second];
  const BarycentricScale scale = barycentric_scale(triangle, p.perspective_correct);
  const uint k = is_second ? 2 : 1;
  const int are_cuts = is_second == t.has_second;  // both; else corner k + 1 is the first cut
  // Weights of corners k and k + 1, relative to corner 0.
  const float2 weight1 = (float2)(weight_of(c, k, 1), weight_of(c, k + 1, 1)) - weight_of(c, 0, 1);
  const float2 weight2 = (float2)(weight_of(c, k, 2), weight_of(c, k + 1, 2)) - weight_of(c, 0, 2);
  for (uint i = run.first; i < run.last; i += DPR_WIDTH) {
    const intn in_run = lanes_before(run.last, i);
    realn x, y;
    load_samples(p, run, in_run, i, &x, &y);
    const realn side = side_of_diagonal(t, view_triangle(t.triangle[0], x, y).edge[DPR_FIRST_DIAGONAL]);
    const intn is_in = in_run && (is_second ? side < 0.0f : !(side < 0.0f));
    if (!any_lane(is_in)) continue;
    const View3 v = view_triangle(triangle, x, y);
    const realn b1 = load_run(is_in, i, grad_bary), b2 = load_run(is_in, i, grad_bary + p.grad_fragments);
    add_barycentric_gradient(v, triangle, scale, load_run(is_in, i, grads + DPR_GRAD_PLANE(p, DEPTH)),
                             weight1.x * b1 + weight2.x * b2, weight1.y * b1 + weight2.y * b2, g);
    realn n[3];
    raw_barycentrics(v, scale, n);
    const realn inverse = inverse_of_clipped(n);
    const realn u1 = greater(n[1], 0.0f) * inverse, u2 = greater(n[2], 0.0f) * inverse;
    part[0] += (are_cuts ? u1 : u2) * between_corners(c, 0, b1, b2);
    if (are_cuts) part[1] += u2 * between_corners(c, 1, b1, b2);
  }
}

/// Gradients of the corners of clipped faces, summed over a pair's fragments. One work-item per pair, up to
/// p.last_pair. Deterministic. Inputs as clip_forward, clip_fragments and rasterize_backward.
/// in out  grad_corners  float[pair][9]   as rasterize_backward leaves it; of clipped faces replaced
/// out     grad_clip     float[pair][9]   of the corners' homogeneous coordinates, by way of the cuts
/// out     grad_cuts     float[2][2][p.pairs]  x and y of where the two cuts of a clipped face are seen,
///                       where some view distorts
kernel void clip_backward(const FrameParams p, global const uint* restrict pairs,
                          global const ViewParams* restrict views, global const ClippedFace* restrict clipped,
                          global const Triangle* restrict triangles, global const uint* restrict pair_face,
                          global const uint* restrict fragment_starts, global const uint* restrict pixels,
                          global const float* restrict fragments, global const float* restrict grads,
                          global float* restrict grad_corners, global float* restrict grad_clip,
                          global float* restrict grad_cuts) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(p.last_pair, pairs[0])) return;
  const uint face = pair_face[pair], last = fragment_starts[pair + 1];
  for (uint k = 0; k < 9; ++k) grad_clip[9 * pair + k] = 0.0f;
  if (clipped[face].corners == 0 || fragment_starts[pair] == last) return;
  const ClippedFace c = clipped[face];
  const ClippedTriangles t = load_clipped(triangles[face], c);
  CornerGradients g[2];
  realn part[2];
  g[0] = g[1] = no_corner_gradients();
  part[0] = part[1] = 0.0f;
  const ClippedRun run = {fragment_starts[pair], last, pixels};
  if (!p.sharp)
    add_outline_distances(p, t, run, fragments + DPR_PLANE(p, DISTANCE), grads + DPR_GRAD_PLANE(p, DISTANCE),
                          g);
  add_outline_barycentrics(p, c, t, 0, run, grads, &g[0], part);
  if (t.has_second) add_outline_barycentrics(p, c, t, 1, run, grads, &g[1], part);
  float3 sum[2][3];
  for (int k = 0; k < 2; ++k) {
    for (int j = 0; j < 3; ++j)
      sum[k][j] = (float3)(sum_lanes(g[k].x[j]), sum_lanes(g[k].y[j]), sum_lanes(g[k].z[j]));
  }
  const OutlineGradients of_outline = {{sum[0][0] + sum[1][0], sum[0][1], sum[0][2] + sum[1][1], sum[1][2]},
                                       {sum_lanes(part[0]), sum_lanes(part[1])}};
  store_corners(p, views + face / p.faces, c, of_outline, grad_corners + 9 * pair, grad_clip + 9 * pair);
  if (!p.distorts) return;
#pragma unroll
  for (uint cut = 0; cut < 2; ++cut) {
    const float2 grad = gradient_of_outline_cut(c, of_outline, cut);
    grad_cuts[(size_t)(2 * cut) * p.pairs + pair] = grad.x;
    grad_cuts[(size_t)(2 * cut + 1) * p.pairs + pair] = grad.y;
  }
}

/// From the gradients of where cuts are seen to what they give to projections and lenses, in place, where
/// some view distorts: a kernel of its own, for want of registers. One work-item per pair, up to p.last_pair.
/// Deterministic. Inputs as clip_backward, and
/// in out  grad_cuts  float[DPR_CUT_CHANNELS][p.pairs]  of which clip_backward has written the first four
kernel void clip_backward_lens(const FrameParams p, global const uint* restrict pairs,
                               global const ViewParams* restrict views,
                               global const ClippedFace* restrict clipped,
                               global const uint* restrict pair_face,
                               global const uint* restrict fragment_starts,
                               global float* restrict grad_cuts) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= min(p.last_pair, pairs[0])) return;
  const uint face = pair_face[pair];
  global const ViewParams* view = views + face / p.faces;
  CutChannels sum = {0.0f, 0.0f};
  if (view->distorts && clipped[face].corners != 0 && fragment_starts[pair] != fragment_starts[pair + 1]) {
    const ClippedFace c = clipped[face];
#pragma unroll
    for (uint cut = 0; cut < 2; ++cut) {
      const float2 grad = (float2)(grad_cuts[(size_t)(2 * cut) * p.pairs + pair],
                                   grad_cuts[(size_t)(2 * cut + 1) * p.pairs + pair]);
      add_cut_channels(p, view, c, cut, grad, &sum);
    }
  }
  store_cut_channels(sum, p.pairs, pair, grad_cuts);
}
