// Open edges, of faces that are alone with their vertices, joined where two lie in one place: a cube with
// four vertices a side is closed as long as these coincide. Found anew by where vertices lie now, in object
// space and by mesh, so that an image does not depend on shapes before it. Places are hashed to lists; which
// of a list's members comes first depends on the run, what is found in it does not.
#include "contour.h"

/// An open edge by its ends.
typedef struct {
  float4 first, second;  // object space
  uint mesh;
  int has_area;  // its face does: no two corners lie in one place
} PlacedEdge;

static inline PlacedEdge placed_edge(uint side, global const uint4* faces, global const MeshPlace* places,
                                     global const float4* positions) {
  const uint4 face = faces[side / 3];
  const uint shift = places[face.w].vertex_shift, corner = side % 3;
  const float4 a = positions[face.x - shift], b = positions[face.y - shift], c = positions[face.z - shift];
  const PlacedEdge e = {corner == 0   ? a
                        : corner == 1 ? b
                                      : c,
                        corner == 0   ? b
                        : corner == 1 ? c
                                      : a,
                        face.w, !is_same(a, b) && !is_same(b, c) && !is_same(c, a)};
  return e;
}

static inline uint mixed(uint hash, float x) {
  const uint bits = x == 0.0f ? 0u : as_uint(x);  // -0 is 0
  const uint product = (hash ^ bits) * 0x9e3779b1u;
  return product ^ product >> 15;
}

static inline uint hash_of_place(float4 v) { return mixed(mixed(mixed(0u, v.x), v.y), v.z); }

/// The same for both directions. `buckets` is a power of two.
static inline uint bucket_of(const PlacedEdge e, uint buckets) {
  return (hash_of_place(e.first) + hash_of_place(e.second) + e.mesh) & (buckets - 1);
}

/// The first open edge of a copy: its faces may be its own.
static inline uint open_of_copy(const FrameParams p, uint4 sizes, uint copy) {
  return p.own_faces ? copy * sizes.y : 0;
}

/// Lists open edges by the hash of their place. One work-item per (copy, open edge).
/// in      open       OpenEdge[open] or, of views' own faces, OpenEdge[copy][open], the last of them DPR_NO_SIDE
/// in      sizes      copies, 1 or the views that have shapes of their own; open edges and buckets of each
/// in      faces      uint4[face]          vertex indices; w = mesh
/// in      places     MeshPlace[mesh]
/// in      positions  float4[position] or, with a stride, float4[view][position]  object space
/// in out  heads      uint[copy][bucket]   an open edge of the bucket, or DPR_NO_OPEN_EDGE, as all are at first
/// out     next       uint[copy][open]     another of its bucket, or DPR_NO_OPEN_EDGE
kernel void edges_list(const FrameParams p, const uint4 sizes, global const OpenEdge* restrict open,
                       global const uint4* restrict faces, global const MeshPlace* restrict places,
                       global const float4* restrict positions, global uint* restrict heads,
                       global uint* restrict next) {
  const uint i = (uint)get_global_id(0);
  if (i >= sizes.x * sizes.y) return;
  const uint copy = i / sizes.y, own = i - copy * sizes.y;
  const uint side = open[open_of_copy(p, sizes, copy) + own].side;
  if (side == DPR_NO_SIDE) return;
  const PlacedEdge e =
      placed_edge(side, faces + first_row(p, copy), places, positions + copy * p.position_stride);
  if (e.has_area) next[i] = atomic_xchg(heads + copy * sizes.z + bucket_of(e, sizes.z), own);
}

/// True if the texture jumps between two open edges in one place.
static inline int texture_jumps(const OpenEdge own, const OpenEdge other, int same_direction) {
  if (own.texture != other.texture) return 1;
  if (own.texture == DPR_NO_TEXTURE) return 0;
  const float4 ways = own.places - (same_direction ? other.places : other.places.zwxy);
  return any(own.is_periodic ? ways != rint(ways) : ways != 0.0f);
}

/// Joins two open edges in one place, and no third there; others are alone. One work-item per (copy, open
/// edge). Deterministic. Inputs as edges_list, and
/// in   mesh_edges  of the scene
/// in   heads, next  as edges_list leaves them
/// in   face_edges  uint[face]  see DPR_FACE_SIDES
/// out  edges       uint2[copy][edge]  the open ones: see DPR_EDGE_FLAG
kernel void edges_join(const FrameParams p, const uint4 sizes, const uint mesh_edges,
                       global const OpenEdge* restrict open, global const uint4* restrict faces,
                       global const MeshPlace* restrict places, global const float4* restrict positions,
                       global const uint* restrict heads, global const uint* restrict next,
                       global const uint* restrict face_edges, global uint2* restrict edges) {
  const uint i = (uint)get_global_id(0);
  if (i >= sizes.x * sizes.y) return;
  const uint copy = i / sizes.y, own = i - copy * sizes.y;
  open += open_of_copy(p, sizes, copy);
  if (open[own].side == DPR_NO_SIDE) return;
  global const float4* of_copy = positions + copy * p.position_stride;
  global const uint4* const its_faces = faces + first_row(p, copy);
  const PlacedEdge e = placed_edge(open[own].side, its_faces, places, of_copy);
  uint other = own, met = 0;
  int same_direction = 0;
  if (e.has_area) {
    for (uint k = heads[copy * sizes.z + bucket_of(e, sizes.z)]; k != DPR_NO_OPEN_EDGE && met < 2;
         k = next[copy * sizes.y + k]) {
      const PlacedEdge o = placed_edge(open[k].side, its_faces, places, of_copy);
      const int along = is_same(e.first, o.first) && is_same(e.second, o.second);
      const int against = is_same(e.first, o.second) && is_same(e.second, o.first);
      if (k == own || o.mesh != e.mesh || !(along || against)) continue;
      other = k;
      same_direction = along;
      ++met;
    }
  }
  uint2 row = (uint2)(open[own].side, DPR_NO_FACE);
  if (met == 1) {
    row = (uint2)(row.x | DPR_EDGE_FLAG, open[other].side / 3 | (same_direction ? DPR_EDGE_FLAG : 0));
    if (texture_jumps(open[own], open[other], same_direction)) row.x |= DPR_EDGE_SEAM;
    if (open[own].material != open[other].material) row.y |= DPR_EDGE_SEAM;
  }
  edges[copy * mesh_edges + edge_at(face_edges, 3 * first_row(p, copy) + open[own].side, 0)] = row;
}
