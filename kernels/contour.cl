// Contours of a view: the edges where its rigid image may jump. An edge is one if both of its faces lie on
// the same side of it in the image (facing changes, or there is one face only), or if its faces' colours or
// normals differ there, or their textures or their places in these, or their materials. Listed by tile, like
// triangles: pairs of tile and contour, counted, listed in the order of the edges, sorted by tile, linked.
//
// Faces are neighbours by the vertices that they share or, at edges where each has vertices of its own, where
// these coincide (edges.cl): then there are two edges, one on each face's, and one of them stands for both.
//
// Edges end at the plane that faces cross, the near one or the far one, and the plane's cut of a face is a
// boundary: the cuts of all faces are numbered behind the edges of the scene.
#include "contour_kind.h"

/// Most that rounding moves a crossing, in samples.
#define DPR_CROSSING_SLACK 0.01f

/// An edge over tiles.
typedef struct {
  float2 a, d;          // an end and the way to the other, in samples
  uint2 columns, rows;  // of tiles, [x, y]: those with a sample from which a step may cross the edge's extent
} TiledEdge;

static inline TiledEdge tiled_edge(const FrameParams p, float2 a, float2 b) {
  TiledEdge e;
  e.a = to_samples(p, a);
  const float2 end = to_samples(p, b);
  e.d = end - e.a;
  e.columns = samples_within(fmin(e.a.x, end.x) - 1.0f, fmax(e.a.x, end.x), p.width) / DPR_TILE;
  e.rows = samples_within(fmin(e.a.y, end.y) - 1.0f, fmax(e.a.y, end.y), p.height) / DPR_TILE;
  return e;
}

/// False only if the line misses every step from a sample of the tile: those reach from its first sample to
/// one behind its last.
static inline int line_meets_tile(const TiledEdge e, uint column, uint row) {
  const float half_extent = 0.5f * DPR_TILE;
  const float2 centre = (float2)((float)(column * DPR_TILE), (float)(row * DPR_TILE)) + half_extent;
  const float side = e.d.x * (centre.y - e.a.y) - e.d.y * (centre.x - e.a.x);
  return !(fabs(side) > (half_extent + DPR_CROSSING_SLACK) * (fabs(e.d.x) + fabs(e.d.y)));
}

/// The shortest contour whose ends' corners count, in samples: a line crosses it wherever it lies. Shorter
/// ones miss lines, and what their ends would add to those, so no end of theirs counts, nor that of another
/// in the same vertex.
#define DPR_LEAST_CORNERED 2.5f

/// Beside the flags of a contour's number in its kind: it is shorter.
#define DPR_CONTOUR_SHORT DPR_CONTOUR_FLAGS

static inline int is_short(const FrameParams p, const ViewEdge e) {
  const float2 d = e.end[1].xy - e.end[0].xy;
  const float least = DPR_LEAST_CORNERED * p.pixel_size;
  return dot(d, d) < least * least;
}

/// False only if an edge lies between two lines of samples, along both axes: then it crosses no step.
static inline int may_cross_line(const TiledEdge e) {
  const float2 low = fmin(e.a, e.a + e.d) - DPR_CROSSING_SLACK,
               high = fmax(e.a, e.a + e.d) + DPR_CROSSING_SLACK;
  return any(floor(low) != floor(high));
}

/// Counts the tiles of every contour. One work-item per (view, edge).
/// in   edges        uint2[edge]           of the scene, or of every view; see DPR_EDGE_FLAG
/// in   facing       uchar[view][face]     as setup and clipping leave it
/// in   ndc, world   float4[view][vertex]
/// in   faces        uint4[...][face]      vertices and, from p.color_faces on, colours of the corners
/// in   clipped      ClippedFace[view][face]  read where p.clips is set
/// in   colors       float4[color] or, with a stride, float4[view][color]
/// in   normal_faces, normals  uint4[face], float4[normal]  read where p.shading is DPR_BESIDE_NORMALS
/// out  counts       uint[view][edge]
/// out  kinds        uchar[view][edge]     DPR_CONTOUR_CREASE, _ONE, _LEFT, _SHORT; 0 of others
kernel void contour_count(const FrameParams p, global const uint2* restrict edges,
                          global const uchar* restrict facing, global const float4* restrict ndc,
                          global const float4* restrict world, global const uint4* restrict faces,
                          global const ClippedFace* restrict clipped, global const float4* restrict colors,
                          global const uint4* restrict normal_faces, global const float4* restrict normals,
                          global uint* restrict counts, global uchar* restrict kinds) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.edges) return;
  const uint view = i / p.edges;
  const ContourScene s =
      scene_of_view(p, view, edges, facing, ndc, world, faces, clipped, colors, normal_faces, normals);
  counts[i] = 0;
  kinds[i] = 0;
  if (is_within_surface(s, i - view * p.edges, p.shading)) return;
  const ViewEdge edge = view_edge(s.edges, i - view * p.edges);
  const int kind = contour_kind(s, edge, p.shading);
  if (kind == DPR_NO_CONTOUR) return;
  const TiledEdge t = tiled_edge(p, edge.end[0].xy, edge.end[1].xy);
  uint count = 0;
  for (uint row = t.rows.x; row <= t.rows.y; ++row) {
    for (uint column = t.columns.x; column <= t.columns.y; ++column)
      count += line_meets_tile(t, column, row) ? 1 : 0;
  }
  if (count == 0) return;
  const int is_left = inner_side(edge_sides(edge.record, s.facing)) > 0;
  const uint crease = kind == DPR_CREASE              ? DPR_CONTOUR_CREASE
                      : kind == DPR_CREASE_OF_COLORS  ? DPR_CONTOUR_CREASE | DPR_CONTOUR_ONE
                      : kind == DPR_CREASE_OF_NORMALS ? DPR_CONTOUR_ONE
                                                      : 0;
  kinds[i] = (uchar)(crease | (is_left ? DPR_CONTOUR_LEFT : 0) | (is_short(p, edge) ? DPR_CONTOUR_SHORT : 0));
  if (may_cross_line(t)) counts[i] = count;
}

/// The contours of a view.
typedef struct {
  EdgeScene edges;
  global const uint* face_edges;               // see DPR_FACE_SIDES
  global const uint *corner_starts, *corners;  // face * 3 + corner, by vertex
  global const uchar* kinds;                   // of the view's edges
} Contours;

/// False only if an edge is a contour, and a short one.
static inline int is_long(const Contours c, uint edge) { return !(c.kinds[edge] & DPR_CONTOUR_SHORT); }

/// The edge of a face between two of its vertices.
static inline uint edge_between(const Contours c, uint face, uint a, uint b) {
  for (uint k = 2 * c.corner_starts[a]; k < 2 * c.corner_starts[a + 1]; ++k) {
    const uint edge = edge_at(c.face_edges, c.corners[k / 2], k % 2);
    if (edge == DPR_NO_MESH_EDGE) continue;
    const uint4 record = record_of(c.edges.edges[edge], c.edges.faces);
    const int is_of_face = own_face(record) == face || (has_other_face(record) && other_face(record) == face);
    if (is_of_face && (record.x == b || record.y == b)) return edge;
  }
  return DPR_NO_MESH_EDGE;
}

/// True if all contours that end in a vertex are that long.
static inline int are_long(const Contours c, uint vertex) {
  for (uint k = 2 * c.corner_starts[vertex]; k < 2 * c.corner_starts[vertex + 1]; ++k) {
    const uint edge = edge_at(c.face_edges, c.corners[k / 2], k % 2);
    if (edge != DPR_NO_MESH_EDGE && !is_long(c, edge)) return 0;
  }
  return 1;
}

/// True if all contours that end in the end of an edge are that long: those of its vertex; or, on the near
/// plane, the edge that is cut there, and the cuts of its faces.
static inline int has_corner(const Contours c, uint edge, const ViewEdge e, uint end) {
  const uint mesh_edges = c.edges.mesh_edges, cut = end == 0 ? e.cut[0] : e.cut[1];
  if (cut == DPR_NO_CUT) return are_long(c, end == 0 ? e.record.x : e.record.y);
  if (edge >= mesh_edges) {
    const ClippedFace of = c.edges.clipped[e.cut_face];
    global const uint4* const face = c.edges.faces + e.cut_face;
    edge = edge_between(c, e.cut_face, corner_in(face, kept_corner(of, cut)),
                        corner_in(face, lost_corner(of, cut)));
    if (edge == DPR_NO_MESH_EDGE) return 0;
  }
  const uint4 record = record_of(c.edges.edges[edge], c.edges.faces);
  return is_long(c, edge) && is_long(c, mesh_edges + own_face(record)) &&
         (!has_other_face(record) || is_long(c, mesh_edges + other_face(record)));
}

/// Lists the tiles of every contour, each at a place of its own. One work-item per (view, edge), or one where
/// there are none. Inputs as contour_count, and
/// in   capacity    places that there are
/// in   face_edges  uint[face]             see DPR_FACE_SIDES
/// in   corner_starts, corners  as normals_forward (normals.cl)
/// in   kinds       uchar[view][edge]      as contour_count leaves them
/// in   offsets     uint[view * edge + 1]  exclusive scan of the counts
/// out  pairs       uint[1]      how many there are; 0 where they do not fit
/// out  place_contour  uint[place]  see DPR_CONTOUR_FLAGS
/// out  place_tile     uint[place]  view * tiles + tile
kernel void contour_fill(const FrameParams p, const uint capacity, global const uint2* restrict edges,
                         global const uint* restrict face_edges, global const uint* restrict corner_starts,
                         global const uint* restrict corners, global const float4* restrict ndc,
                         global const uint4* restrict faces, global const ClippedFace* restrict clipped,
                         global const uchar* restrict kinds, global const uint* restrict offsets,
                         global uint* restrict pairs, global uint* restrict place_contour,
                         global uint* restrict place_tile) {
  const uint i = (uint)get_global_id(0), total = offsets[p.views * p.edges];
  if (i == 0) pairs[0] = total > capacity ? 0 : total;
  if (i >= p.views * p.edges || total > capacity || offsets[i] == offsets[i + 1]) return;
  const uint view = i / p.edges;
  const EdgeScene s = edges_of_view(p, view, edges, faces, ndc, clipped);
  const uint first_edge = view * p.edges;
  const ViewEdge edge = view_edge(s, i - first_edge);
  uint contour = DPR_CONTOUR_FLAGS * i + kinds[i] % DPR_CONTOUR_FLAGS;
  const Contours contours = {s, face_edges, starts_of_view(p, view, p.vertices, corner_starts), corners,
                             kinds + first_edge};
  if (has_corner(contours, i - first_edge, edge, 0)) contour |= DPR_CONTOUR_FIRST_END;
  if (has_corner(contours, i - first_edge, edge, 1)) contour |= DPR_CONTOUR_SECOND_END;
  const TiledEdge t = tiled_edge(p, edge.end[0].xy, edge.end[1].xy);
  const uint first_tile = view * p.tiles_x * p.tiles_y;
  uint place = offsets[i];
  for (uint row = t.rows.x; row <= t.rows.y; ++row) {
    for (uint column = t.columns.x; column <= t.columns.y; ++column) {
      if (!line_meets_tile(t, column, row)) continue;
      place_contour[place] = contour;
      place_tile[place] = first_tile + row * p.tiles_x + column;
      ++place;
    }
  }
}

/// Adds the gradients of contours' ends to those of the vertices: each vertex the contours at its corners in
/// order, each contour its pairs. Any number of work-items, by end of a pair: vertices are many, and few have
/// a contour. That of the first pair of the first contour of a vertex sums for the vertex. Deterministic.
/// in      pairs         uint[1]                how many there are
/// in      pair_contour  uint[pair]             see DPR_CONTOUR_FLAGS
/// in      pair_starts   uint[view * edge + 1]  runs of `edge_pairs`
/// in      edge_pairs    uint[...]
/// in      edges         uint2[edge]            of the scene; see DPR_EDGE_FLAG
/// in      faces         uint4[face]            vertex indices
/// in      face_edges    uint[face]             see DPR_FACE_SIDES
/// in      corner_starts, corners               as normals_forward (normals.cl)
/// in      grad_ends     float4[pair]           of x, y of the first end, x, y of the second, NDC
/// in out  grad_ndc      float4[view][vertex]
kernel void contour_gather(const FrameParams p, global const uint* restrict pairs,
                           global const uint* restrict pair_contour, global const uint* restrict pair_starts,
                           global const uint* restrict edge_pairs, global const uint2* restrict edges,
                           global const uint4* restrict faces, global const uint* restrict face_edges,
                           global const uint* restrict corner_starts, global const uint* restrict corners,
                           global const float4* restrict grad_ends, global float4* restrict grad_ndc) {
  for (uint i = (uint)get_global_id(0); i < 2 * pairs[0]; i += (uint)get_global_size(0)) {
    const uint pair = i / 2;
    const uint contour = pair_contour[pair] / DPR_CONTOUR_FLAGS, view = contour / p.edges;
    const uint own = contour - view * p.edges;
    if (own >= p.mesh_edges || edge_pairs[pair_starts[contour]] != pair) continue;
    const uint4 record = record_of(edges_of_shape(p, view, edges)[own], faces + first_row(p, view));
    const uint vertex = i % 2 == 0 ? record.x : record.y;
    global const uint* const run = starts_of_view(p, view, p.vertices, corner_starts) + vertex;
    global const uint* starts = pair_starts + view * p.edges;
    uint first = DPR_NO_MESH_EDGE;
    float2 sum = 0.0f;
    for (uint k = 2 * run[0]; k < 2 * run[1]; ++k) {
      const uint edge = edge_at(face_edges, corners[k / 2], k % 2);
      if (edge == DPR_NO_MESH_EDGE || starts[edge] == starts[edge + 1]) continue;
      first = min(first, edge);
      if (first < own) break;
      for (uint place = starts[edge]; place < starts[edge + 1]; ++place) {
        const float4 grad = grad_ends[edge_pairs[place]];
        sum += k % 2 ? grad.zw : grad.xy;
      }
    }
    if (first == own) grad_ndc[view * p.vertices + vertex] += (float4)(sum, 0.0f, 0.0f);
  }
}

/// The gradients of a contour's ends, summed over its pairs.
static inline float4 sum_of_pairs(uint contour, global const uint* pair_starts, global const uint* edge_pairs,
                                  global const float4* grad_ends) {
  float4 sum = 0.0f;
  for (uint place = pair_starts[contour]; place < pair_starts[contour + 1]; ++place)
    sum += grad_ends[edge_pairs[place]];
  return sum;
}

/// Gradient that a contour's end on a cut gives to one of the corners beside the cut.
static inline float3 share_of_cut(const FrameParams p, global const ViewParams* view, const ClippedFace c,
                                  uint cut, int to_lost, float2 grad) {
  const float part = clipped_cut(c, cut).w;
  return (to_lost ? part : 1.0f - part) * cut_gradient(p, view, c, cut, grad, 0.0f);
}

/// Takes the gradients of edges away that contour_gather() has given to corners that are lost.
/// One work-item per (view, vertex). Inputs as contour_count and contour_gather, and
/// in out  grad_ndc  float4[view][vertex]
kernel void contour_drop_near(const FrameParams p, global const ClippedFace* restrict clipped,
                              global const uint* restrict corner_starts, global const uint* restrict corners,
                              global float4* restrict grad_ndc) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.vertices) return;
  const uint view = i / p.vertices, vertex = i - view * p.vertices;
  global const uint* const run = starts_of_view(p, view, p.vertices, corner_starts) + vertex;
  for (uint k = run[0]; k < run[1]; ++k) {
    global const ClippedFace* face = clipped + view * p.faces + corners[k] / 3 - first_row(p, view);
    if (face->corners != 0 && is_lost(*face, corners[k] % 3)) grad_ndc[i] = 0.0f;
  }
}

/// Adds the gradients of contours' ends on a plane to those of the corners that these lie between. One
/// work-item per (view, vertex). Deterministic. Inputs as contour_count and contour_gather, and
/// in      views          ViewParams[view]
/// in out  grad_clip      float4[view][vertex]  of homogeneous coordinates
/// out     grad_cuts      float[DPR_CUT_CHANNELS][view][vertex]  where some view distorts; cuts count at the
///                        corner that is kept
kernel void contour_gather_cuts(const FrameParams p, global const ViewParams* restrict views,
                                global const uint2* restrict edges, global const uint4* restrict faces,
                                global const float4* restrict ndc, global const ClippedFace* restrict clipped,
                                global const uint* restrict pair_starts,
                                global const uint* restrict edge_pairs,
                                global const uint* restrict face_edges,
                                global const uint* restrict corner_starts,
                                global const uint* restrict corners, global const float4* restrict grad_ends,
                                global float4* restrict grad_clip, global float* restrict grad_cuts) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.vertices) return;
  const uint view = i / p.vertices, vertex = i - view * p.vertices, first_edge = view * p.edges;
  const EdgeScene s = edges_of_view(p, view, edges, faces, ndc, clipped);
  global const uint* const run = starts_of_view(p, view, p.vertices, corner_starts) + vertex;
  float3 sum = 0.0f;
  CutChannels of_cuts = {0.0f, 0.0f};
  for (uint k = run[0]; k < run[1]; ++k) {
    const uint face = corners[k] / 3 - first_row(p, view), corner = corners[k] % 3;
    if (s.clipped[face].corners == 0) continue;
    const ClippedFace of = s.clipped[face];
    const float4 grad = sum_of_pairs(first_edge + p.mesh_edges + face, pair_starts, edge_pairs, grad_ends);
    for (uint cut = 0; cut < 2; ++cut) {
      const float2 at_cut = cut == 0 ? grad.xy : grad.zw;
      const int to_lost = lost_corner(of, cut) == corner, to_kept = kept_corner(of, cut) == corner;
      if (to_lost || to_kept) sum += share_of_cut(p, views + view, of, cut, to_lost, at_cut);
      if (to_kept && views[view].distorts) add_cut_channels(p, views + view, of, cut, at_cut, &of_cuts);
    }
  }
  for (uint k = 2 * run[0]; k < 2 * run[1]; ++k) {
    const uint own_end = k % 2, edge = edge_at(face_edges, corners[k / 2], own_end);
    if (edge == DPR_NO_MESH_EDGE) continue;
    const ViewEdge e = view_edge(s, edge);
    const uint end = e.cut[0] != DPR_NO_CUT ? 0 : 1, cut = min(e.cut[0], e.cut[1]);
    if (!e.is_there || cut == DPR_NO_CUT) continue;
    const float4 grad = sum_of_pairs(first_edge + edge, pair_starts, edge_pairs, grad_ends);
    const ClippedFace of = s.clipped[e.cut_face];
    const float2 at_cut = end == 0 ? grad.xy : grad.zw;
    sum += share_of_cut(p, views + view, of, cut, own_end == end, at_cut);
    if (own_end != end && views[view].distorts) add_cut_channels(p, views + view, of, cut, at_cut, &of_cuts);
  }
  if (p.distorts) store_cut_channels(of_cuts, p.views * p.vertices, i, grad_cuts);
  grad_clip[i] += (float4)(sum, 0.0f);
}
