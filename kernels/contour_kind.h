// What a mesh edge is in a view: no contour, one that occludes what lies behind, or a crease.
#ifndef DPR_CONTOUR_KIND_H
#define DPR_CONTOUR_KIND_H

#include "contour.h"
#include "face_normal.h"

/// The sine of the angle between faces from which they count as shaded differently.
#define DPR_LEAST_CREASE 1e-4f

/// Everything that says what an edge is; of one view.
typedef struct {
  global const uchar* facing;        // [face]
  global const float4 *ndc, *world;  // [vertex]
  global const uint4 *faces, *face_colors;
  global const float4* colors;
  global const uint4* normal_faces;  // read of frames that show normals beside colours
  global const float4* normals;
  EdgeScene edges;
} ContourScene;

/// Number of the face's corner that a vertex is, or coincides with; 3 where none does.
static inline uint corner_at(uint4 face, uint vertex, global const float4* ndc) {
  const float4 v = ndc[vertex];
  return is_same(ndc[face.x], v) ? 0 : is_same(ndc[face.y], v) ? 1 : is_same(ndc[face.z], v) ? 2 : 3;
}

/// True if the faces' colours, or other values, differ at an end of the edge.
DPR_ALWAYS_INLINE int jumps(const ContourScene s, uint4 edge, global const uint4* rows,
                            global const float4* values) {
  const uint own = own_face(edge), other = other_face(edge);
#pragma unroll 1
  for (int end = 0; end < 2; ++end) {
    const uint vertex = end == 0 ? edge.x : edge.y;
    const uint in_own = corner_at(s.faces[own], vertex, s.ndc),
               in_other = corner_at(s.faces[other], vertex, s.ndc);
    if (!is_same(values[corner_in(rows + own, in_own)], values[corner_in(rows + other, in_other)])) return 1;
  }
  return 0;
}

static inline int normals_differ(const ContourScene s, uint4 edge) {
  const float3 n0 = face_normal(s.world, s.faces[own_face(edge)]);
  const float3 n1 = face_normal(s.world, s.faces[other_face(edge)]);
  const float3 c = cross(n0, n1);
  return dot(c, c) > DPR_LEAST_CREASE * DPR_LEAST_CREASE * dot(n0, n0) * dot(n1, n1);
}

/// True if an edge on vertices of its own face alone is the one that stands for both: the one whose face is
/// in front.
static inline int stands_for_both(uint4 edge, global const uchar* facing) {
  const uint own = facing[own_face(edge)], other = facing[other_face(edge)];
  const int own_rank = own == DPR_FACE_DROPPED ? 0 : own == DPR_FACE_BACK ? 1 : 2;
  const int other_rank = other == DPR_FACE_DROPPED ? 0 : other == DPR_FACE_BACK ? 1 : 2;
  return own_rank > other_rank || (own_rank == other_rank && own_face(edge) < other_face(edge));
}

/// True if an edge lies within a surface, where nothing can jump: most do, and none of their ends is read.
static inline int is_within_surface(const ContourScene s, uint edge, uint shading) {
  if (edge >= s.edges.mesh_edges || shading == DPR_FLAT) return 0;
  const uint2 sides_of = s.edges.edges[edge];
  if ((sides_of.x & (DPR_EDGE_FLAG | DPR_EDGE_SEAM)) || sides_of.y == DPR_NO_FACE ||
      (sides_of.y & DPR_EDGE_SEAM))
    return 0;
  const EdgeSides sides = edge_sides((uint4)(0, 0, sides_of.x / 3, sides_of.y), s.facing);
  return sides.own == -sides.other;
}

static inline int color_jumps(const ContourScene s, uint4 edge) {
  return jumps(s, edge, s.face_colors, s.colors);
}

/// Of an edge within what is seen, in a frame that shows normals beside colours.
static inline int kind_beside_normals(const ContourScene s, uint4 edge) {
  const int may_jump = (edge.z & DPR_EDGE_FLAG) != 0;
  const int of_colors = (edge.z & DPR_EDGE_SEAM) || (may_jump && color_jumps(s, edge));
  const int of_normals = (may_jump || (edge.w & DPR_EDGE_SEAM)) && jumps(s, edge, s.normal_faces, s.normals);
  if (of_colors) return of_normals ? DPR_CREASE : DPR_CREASE_OF_COLORS;
  return of_normals ? DPR_CREASE_OF_NORMALS : DPR_NO_CONTOUR;
}

static inline int contour_kind(const ContourScene s, const ViewEdge e, uint shading) {
  const uint4 edge = e.record;
  if (!e.is_there) return DPR_NO_CONTOUR;
  EdgeSides sides = edge_sides(edge, s.facing);
  if (!has_other_face(edge)) return sides.own != 0 ? DPR_OCCLUDES : DPR_NO_CONTOUR;
  int is_split = 0;
  if (edge.z & DPR_EDGE_FLAG) {
    const uint4 other = s.faces[other_face(edge)];
    is_split = !(other.x == edge.x || other.y == edge.x || other.z == edge.x) ||
               !(other.x == edge.y || other.y == edge.y || other.z == edge.y);
    if (is_split && !stands_for_both(edge, s.facing)) return DPR_NO_CONTOUR;
  }
  if (sides.own != -sides.other) return DPR_OCCLUDES;
  if (sides.own == 0) return DPR_NO_CONTOUR;
  if (shading == DPR_BESIDE_NORMALS) return kind_beside_normals(s, edge);
  if (edge.z & DPR_EDGE_SEAM) return DPR_CREASE;
  if (shading != DPR_UNLIT && (edge.w & DPR_EDGE_SEAM)) return DPR_CREASE;
  if (shading == DPR_FLAT && normals_differ(s, edge)) return DPR_CREASE;
  if (!(edge.z & DPR_EDGE_FLAG)) return DPR_NO_CONTOUR;
  if (is_split && shading != DPR_UNLIT && shading != DPR_FLAT) return DPR_CREASE;
  return color_jumps(s, edge) ? DPR_CREASE : DPR_NO_CONTOUR;
}

static inline ContourScene scene_of_view(const FrameParams p, uint view, global const uint2* edges,
                                         global const uchar* facing, global const float4* ndc,
                                         global const float4* world, global const uint4* faces,
                                         global const ClippedFace* clipped, global const float4* colors,
                                         global const uint4* normal_faces, global const float4* normals) {
  ContourScene s;
  s.facing = facing + view * p.faces;
  s.ndc = ndc + view * p.vertices;
  s.world = world + view * p.vertices;
  s.faces = faces + first_row(p, view);
  s.face_colors = s.faces + p.color_faces;
  s.colors = colors + view * p.color_stride;
  s.normal_faces = normal_faces;
  s.normals = normals;
  s.edges = edges_of_view(p, view, edges, faces, ndc, clipped);
  return s;
}

#endif
