// Triangles of a view: assembled from projected vertices, culled, bounded, and the tiles of each counted.
#include "face_rows.h"
#include "group.h"
#include "setup.h"

/// +1 where a triangle's corners wind counter-clockwise, -1 where clockwise; 0 where it reaches nearer than
/// znear or further than zfar, or has exactly no area. Written so that a NaN fails.
static inline int orientation_of(float3 a, float3 b, float3 c, float znear, float zfar) {
  const int in_view =
      a.z >= znear && b.z >= znear && c.z >= znear && a.z <= zfar && b.z <= zfar && c.z <= zfar;
  return in_view && fabs(a.x + a.y + b.x + b.y + c.x + c.y) < INFINITY ? side_of_line(a.xy, b.xy, c.xy) : 0;
}

/// False for what reaches beyond DPR_MAX_NDC.
static inline int is_in_range(float3 a, float3 b, float3 c) {
  const float2 reach = fmax(fmax(fabs(a.xy), fabs(b.xy)), fabs(c.xy));
  return fmax(reach.x, reach.y) < DPR_MAX_NDC;
}

/// Vertices of a face of a view.
typedef struct {
  float3 a, b, c;
  uint view, mesh;
} Corners;

static inline Corners corners_of(const FrameParams p, uint i, global const uint4* restrict faces,
                                 global const float4* restrict ndc) {
  const uint view = i / p.faces;
  const uint4 face = faces[first_row(p, view) + i - view * p.faces];
  global const float4* vertices = ndc + view * p.vertices;
  const Corners corners = {vertices[face.x].xyz, vertices[face.y].xyz, vertices[face.z].xyz, view, face.w};
  return corners;
}

/// Assembles a triangle; returns whether it is kept.
static inline int set_up(const FrameParams p, uint i, const Corners corners,
                         global const ViewParams* restrict views, global const float* restrict hidden,
                         global uchar* restrict facing, Triangle* t) {
  const float3 a = corners.a, b = corners.b, c = corners.c;
  const uint view = corners.view;
  int orientation = orientation_of(a, b, c, views[view].znear, views[view].zfar);
  if ((float)orientation == p.culled) orientation = 0;
  facing[i] = facing_of(orientation);
  const PixelBounds bounds = bounds_of(p, fmin(fmin(a.xy, b.xy), c.xy), fmax(fmax(a.xy, b.xy), c.xy));
  const int is_kept = orientation != 0 && (float)orientation != hidden[view * p.meshes + corners.mesh] &&
                      is_in_range(a, b, c) && meets_image(p, bounds);
  if (!is_kept) return 0;
  const uint2 columns = samples_within(bounds.left, bounds.right, p.width);
  const uint2 rows = samples_within(bounds.top, bounds.bottom, p.height);
  t->x0 = a.x;
  t->y0 = a.y;
  t->x1 = b.x;
  t->y1 = b.y;
  t->x2 = c.x;
  t->y2 = c.y;
  t->z0 = a.z;
  t->z1 = b.z;
  t->z2 = c.z;
  t->orientation = (float)orientation;
  t->first_sample = columns.x | rows.x << 16;
  t->last_sample = columns.y | rows.y << 16;
  return 1;
}

/// Assembles the triangles, and counts the tiles of each. Dropped is what has no orientation, is culled or
/// not in range, cannot be seen, or whose blurred bounds miss the image; what is kept has no tile where its
/// bounds hold no sample, or it is small and owns none. One work-item per (view, face), and the tiles of large ones
/// are a group's to count; of a CPU one per DPR_FACE_GROUP faces, whose vertices it fetches together: where faces that
/// follow each other lie far apart, it waits for memory once.
/// in   views      ViewParams[view]
/// in   faces      uint4[face]             vertex indices; w = mesh
/// in   ndc        float4[view][vertex]
/// in   hidden     float[view][mesh]       the orientation of faces that nothing can see; 0: all may be seen
/// out  facing     uchar[view][face]       see DPR_FACE_DROPPED; of what is not seen too
/// out  kept       uchar[view][face]       0 or 1
/// out  counts     uint[view][face]        tiles that are listed for it
/// out  triangles  Triangle[view][face]    means nothing where there is no tile
DPR_SHARING_KERNEL kernel void setup_forward(
    const FrameParams p, global const ViewParams* restrict views, global const uint4* restrict faces,
    global const float4* restrict ndc, global const float* restrict hidden, global uchar* restrict facing,
    global uchar* restrict kept, global uint* restrict counts, global Triangle* restrict triangles) {
  const uint item = (uint)get_global_id(0), end = p.views * p.faces;
#if DPR_LANES == 1
  local uint shared[DPR_GROUP], sums[DPR_GROUP];
  Triangle t;
  const int is_kept =
      item < end && set_up(p, item, corners_of(p, item, faces, ndc), views, hidden, facing, &t);
  const int shares = is_kept && is_shared(t);
  if (shares) triangles[item] = t;
  const uint last = group_collect(shares, item, shared, sums);
  barrier(CLK_GLOBAL_MEM_FENCE);
  for (uint k = 0; k < last; ++k) {
    const Triangle large = triangles[shared[k]];
    group_scan(count_tiles(p, large, shared_rows(large)), sums);
    if (get_local_id(0) == 0) counts[shared[k]] = sums[DPR_GROUP - 1];
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  if (item < end) kept[item] = is_kept ? 1 : 0;
  if (item >= end || shares) return;
  const uint count = is_kept ? count_tiles(p, t, rows_of(t) / DPR_TILE) : 0;
  counts[item] = count;
  if (count > 0) triangles[item] = t;
#else
  const uint first = item * DPR_FACE_GROUP, last = min(first + DPR_FACE_GROUP, end);
  Corners corners[DPR_FACE_GROUP];
  for (uint i = first; i < last; ++i) corners[i - first] = corners_of(p, i, faces, ndc);
  for (uint i = first; i < last; ++i) {
    Triangle t;
    const int is_kept = set_up(p, i, corners[i - first], views, hidden, facing, &t);
    const uint count = is_kept ? count_tiles(p, t, rows_of(t) / DPR_TILE) : 0;
    kept[i] = is_kept ? 1 : 0;
    counts[i] = count;
    if (count > 0) triangles[i] = t;
  }
#endif
}

/// Six times the volumes of the tetrahedra between a mesh's first position and its faces: their sum is the volume of
/// a closed mesh, above 0 where faces wind counter-clockwise as seen from outside. One work-item per DPR_VOLUME_FACES
/// faces.
/// in   first     uint4                  of the mesh: face, faces, vertex less position, position
/// in   runs      work-items of the mesh
/// in   faces     uint4[face]            vertex indices
/// in   positions float4[position]       object space
/// out  volumes   float[2][run]          sums; sums of the products of lengths that rounding is in proportion to
kernel void setup_volumes(const uint4 first, const uint runs, global const uint4* restrict faces,
                          global const float4* restrict positions, global float* restrict volumes) {
  const uint run = (uint)get_global_id(0);
  if (run >= runs) return;
  const float3 origin = positions[first.w].xyz;
  const uint begin = run * DPR_VOLUME_FACES, end = min(begin + DPR_VOLUME_FACES, first.y);
  float sum = 0.0f, magnitude = 0.0f;
  for (uint i = begin; i < end; ++i) {
    const uint4 face = faces[first.x + i];
    const float3 a = positions[face.x - first.z].xyz, b = positions[face.y - first.z].xyz - a,
                 c = positions[face.z - first.z].xyz - a, side = a - origin;
    sum += dot(side, cross(b, c));
    magnitude += sqrt(dot(side, side) * dot(b, b) * dot(c, c));
  }
  volumes[run] = sum;
  volumes[runs + run] = magnitude;
}

/// Part of the products of lengths that a volume must have for its sign to count: what is less may be rounding.
#define DPR_LEAST_VOLUME 1e-5f

/// The orientation of faces that nothing can see, from that of meshes whose faces wind counter-clockwise. One
/// work-item per (view, mesh). Written so that a NaN hides nothing.
/// in   p
/// in   sources   uint[mesh]             itself, or the mesh of which it is an instance
/// in   volumes   float[mesh][2]         as setup_volumes has them, summed
/// in   assumed   float[view][mesh]
/// out  hidden    float[view][mesh]
kernel void setup_hidden(const FrameParams p, global const uint* restrict sources,
                         global const float* restrict volumes, global const float* restrict assumed,
                         global float* restrict hidden) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.meshes) return;
  const uint source = sources[i % p.meshes];
  const float volume = volumes[2 * source], least = DPR_LEAST_VOLUME * volumes[2 * source + 1];
  hidden[i] = volume > least ? assumed[i] : volume < -least ? -assumed[i] : 0.0f;
}
