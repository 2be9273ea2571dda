// Contours: the mesh edges at which a view's rigid image may jump. Shared by the stage that finds them and
// the one that blends samples across them.
#ifndef DPR_CONTOUR_H
#define DPR_CONTOUR_H

#include "clip.h"
#include "face_rows.h"
#include "geometry.h"

/// Role of an edge in a view. A contour occludes the surface behind it; a crease has surface on both sides.
#define DPR_NO_CONTOUR 0
#define DPR_OCCLUDES 1
#define DPR_CREASE 2
/// Creases in frames that show normals beside colours, where one of the two jumps and the other does not.
#define DPR_CREASE_OF_COLORS 3
#define DPR_CREASE_OF_NORMALS 4

/// Of a contour's number.
static inline int is_crease(uint contour) { return (contour & (DPR_CONTOUR_CREASE | DPR_CONTOUR_ONE)) != 0; }

/// True of a contour at which colours jump while crossings are found for normals, or the reverse.
static inline int is_left_out(const FrameParams p, uint contour) {
  const uint crease = contour & (DPR_CONTOUR_CREASE | DPR_CONTOUR_ONE);
  return (p.shading == DPR_BESIDE_NORMALS && crease == DPR_CONTOUR_ONE) ||
         (p.shading == DPR_NORMALS && crease == (DPR_CONTOUR_CREASE | DPR_CONTOUR_ONE));
}

/// On which sides of an edge its faces lie: +1 to the left of first -> second end, -1 to the right, 0 where
/// there is none, or a dropped one.
typedef struct {
  int own, other;
} EdgeSides;

static inline int side_of_face(uint facing) {
  return facing == DPR_FACE_DROPPED ? 0 : facing == DPR_FACE_FRONT ? 1 : -1;
}

/// An edge as it is looked at: its ends, own face and other face, with the flags of both.
static inline uint4 record_of(uint2 edge, global const uint4* faces) {
  const uint flags = DPR_EDGE_FLAG | DPR_EDGE_SEAM, side = edge.x & ~flags, own = side / 3,
             corner = side - 3 * own;
  return (uint4)(corner_in(faces + own, corner), corner_in(faces + own, (corner + 1) % 3),
                 own | (edge.x & flags), edge.y);
}

/// The edge whose first end (0) or second end (1) is a corner, 3 * face + corner; DPR_NO_MESH_EDGE where the
/// side there is not the own side of one.
static inline uint edge_at(global const uint* face_edges, uint corner, uint end) {
  const uint face = corner / 3, of_face = corner - 3 * face, side = end == 0 ? of_face : (of_face + 2) % 3;
  const uint sides = face_edges[face];
  if (!(sides >> side & 1u)) return DPR_NO_MESH_EDGE;
  return sides / DPR_FACE_SIDES + popcount(sides & ((1u << side) - 1));
}

static inline int has_other_face(uint4 edge) { return edge.w != DPR_NO_FACE; }
static inline uint own_face(uint4 edge) { return edge.z & ~(DPR_EDGE_FLAG | DPR_EDGE_SEAM); }
static inline uint other_face(uint4 edge) { return edge.w & ~(DPR_EDGE_FLAG | DPR_EDGE_SEAM); }

/// `facing` is the view's.
static inline EdgeSides edge_sides(uint4 edge, global const uchar* facing) {
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

static inline int is_same(float4 a, float4 b) { return all(a.xyz == b.xyz); }

/// The corner of a face that lies at neither end of its edge. By place: the ends may be vertices that only
/// coincide with the face's.
static inline float3 corner_across(uint4 face, uint4 edge, global const float4* ndc) {
  const float4 first = ndc[edge.x], second = ndc[edge.y], x = ndc[face.x], y = ndc[face.y];
  if (!is_same(x, first) && !is_same(x, second)) return x.xyz;
  return !is_same(y, first) && !is_same(y, second) ? y.xyz : ndc[face.z].xyz;
}

/// Number of the face's corner that a vertex is; 3 where it is none.
static inline uint corner_of_vertex(uint4 face, uint vertex) {
  return face.x == vertex ? 0 : face.y == vertex ? 1 : face.z == vertex ? 2 : 3;
}

/// Inputs from which the edges of a view are read.
typedef struct {
  global const uint2* edges;
  global const uint4* faces;          // of the view
  global const float4* ndc;           // [vertex] of the view
  global const ClippedFace* clipped;  // [face] of the view; not read where no face is clipped
  uint mesh_edges, clips;
} EdgeScene;

/// The scene's edges where a view has the vertices: it may have a shape of its own.
static inline global const uint2* edges_of_shape(const FrameParams p, uint view, global const uint2* edges) {
  return edges + (p.position_stride != 0 ? view * p.mesh_edges : 0);
}

static inline EdgeScene edges_of_view(const FrameParams p, uint view, global const uint2* edges,
                                      global const uint4* faces, global const float4* ndc,
                                      global const ClippedFace* clipped) {
  const EdgeScene s = {edges_of_shape(p, view, edges),
                       faces + first_row(p, view),
                       ndc + view * p.vertices,
                       clipped + (p.clips ? view * p.faces : 0),
                       p.mesh_edges,
                       p.clips};
  return s;
}

/// The number of a cut that an edge's end is none of.
#define DPR_NO_CUT 2

/// An edge as a view has it.
typedef struct {
  uint4 record;   // record_of(); of the cut of a face (face, none) without vertices
  float4 end[2];  // x, y in NDC, depth; w is not used
  int is_there;   // 0: all of it is nearer than the near plane
  uint cut_face;  // whose cuts the ends are
  uint cut[2];    // which of them, or DPR_NO_CUT: then the end is the vertex
} ViewEdge;

/// The edge on the near plane that a face has got there, in the direction in which the face winds.
static inline ViewEdge edge_of_cut(const EdgeScene s, uint face) {
  const int is_there = s.clipped[face].corners != 0;
  const float4 none = 0.0f;  // zeros in the initializer itself crash Mesa 22.3's compiler
  const ViewEdge e = {(uint4)(0, 0, face, DPR_NO_FACE),
                      {is_there ? s.clipped[face].cut[0] : none, is_there ? s.clipped[face].cut[1] : none},
                      is_there,
                      face,
                      {0, 1}};
  return e;
}

/// Puts an end that is nearer than the near plane on it, where one of the edge's faces is clipped.
static inline void clip_edge(const EdgeScene s, ViewEdge* e) {
  e->cut_face = own_face(e->record);
  if (s.clipped[e->cut_face].corners == 0) {
    if (!has_other_face(e->record)) return;
    e->cut_face = other_face(e->record);
    if (s.clipped[e->cut_face].corners == 0) return;
  }
  global const ClippedFace* clipped = s.clipped + e->cut_face;
  const ClippedFace c = *clipped;
  const uint4 face = s.faces[e->cut_face];
  const uint first = corner_of_vertex(face, e->record.x), second = corner_of_vertex(face, e->record.y);
  // Vertices that only coincide with the face's: its own edge there stands for both.
  if (first == 3 || second == 3) return;
  const int loses_first = is_lost(c, first), loses_second = is_lost(c, second);
  e->is_there = !(loses_first && loses_second);
  if (loses_first == loses_second) return;
  // Chosen by value, and the cut read where it lies: a place that varies would put edge and face into memory.
  const uint cut = loses_first ? cut_between(c, second, first) : cut_between(c, first, second);
  const float4 end = clipped->cut[cut];
  e->cut[0] = loses_first ? cut : DPR_NO_CUT;
  e->cut[1] = loses_first ? DPR_NO_CUT : cut;
  e->end[0] = loses_first ? end : e->end[0];
  e->end[1] = loses_first ? e->end[1] : end;
}

static inline ViewEdge view_edge(const EdgeScene s, uint edge) {
  if (edge >= s.mesh_edges) return edge_of_cut(s, edge - s.mesh_edges);
  const uint4 record = record_of(s.edges[edge], s.faces);
  ViewEdge e = {record, {s.ndc[record.x], s.ndc[record.y]}, 1, 0, {DPR_NO_CUT, DPR_NO_CUT}};
  if (s.clips) clip_edge(s, &e);
  return e;
}

/// NDC to samples: the centre of column c or row r is at c or r.
static inline float column_at(const FrameParams p, float x) {
  return x * (1.0f / p.pixel_size) + 0.5f * (float)p.width - 0.5f;
}
static inline float row_at(const FrameParams p, float y) {
  return 0.5f * (float)p.height - 0.5f - y * (1.0f / p.pixel_size);
}
static inline float2 to_samples(const FrameParams p, float2 ndc) {
  return (float2)(column_at(p, ndc.x), row_at(p, ndc.y));
}

/// The part of a tile that lies on the raster, [first, last) columns and rows.
typedef struct {
  int first_column, last_column, first_row, last_row;
} TileSamples;

static inline TileSamples tile_samples(const FrameParams p, uint tile) {
  const uint in_view = tile % (p.tiles_x * p.tiles_y);
  TileSamples s;
  s.first_column = (int)(in_view % p.tiles_x * DPR_TILE);
  s.first_row = (int)(in_view / p.tiles_x * DPR_TILE);
  s.last_column = min(s.first_column + DPR_TILE, (int)p.width);
  s.last_row = min(s.first_row + DPR_TILE, (int)p.height);
  return s;
}

/// True if a contour lies in one of the tiles [first, last] of a row; `tile_starts` are runs of pairs.
static inline int have_contours(global const uint* tile_starts, uint first, uint last) {
  return tile_starts[last + 1] > tile_starts[first];
}

/// True if a contour may cross a step of a tile's cells: it lies there, or in the tiles to the left and
/// above, whose steps reach into it.
static inline int may_be_crossed(const FrameParams p, uint tile, global const uint* tile_starts) {
  const uint in_view = tile % (p.tiles_x * p.tiles_y), left = in_view % p.tiles_x > 0 ? 1 : 0;
  if (have_contours(tile_starts, tile - left, tile)) return 1;
  return in_view >= p.tiles_x && have_contours(tile_starts, tile - p.tiles_x, tile - p.tiles_x);
}

/// The tiles at most `reach` away from one, that one among them: a rectangle, row by row.
typedef struct {
  uint first, columns, rows;
} NearTiles;

static inline NearTiles near_tiles(const FrameParams p, uint tile, uint reach) {
  const uint in_view = tile % (p.tiles_x * p.tiles_y), column = in_view % p.tiles_x,
             row = in_view / p.tiles_x;
  const uint left = min(column, reach), above = min(row, reach);
  const NearTiles tiles = {tile - left - above * p.tiles_x, 1 + left + min(p.tiles_x - 1 - column, reach),
                           1 + above + min(p.tiles_y - 1 - row, reach)};
  return tiles;
}

/// True if a contour lies at most `reach` tiles away from a tile.
static inline int is_near_contour(const FrameParams p, uint tile, uint reach,
                                  global const uint* tile_starts) {
  const NearTiles tiles = near_tiles(p, tile, reach);
  for (uint row = 0; row < tiles.rows; ++row) {
    const uint first = tiles.first + row * p.tiles_x;
    if (have_contours(tile_starts, first, first + tiles.columns - 1)) return 1;
  }
  return 0;
}

#endif
