// Triangles of a view: assembled from projected vertices, culled, bounded.
#include "ownership.h"
#include "shared_types.h"

/// Corners further away than this, NDC, have squared distances that single precision does not hold.
#define DPR_MAX_NDC 1e18f

/// The tiles along one axis that [low, high] (pixels, clipped to the image) touches; first > last if none.
static inline uint2 tile_range(float low, float high, uint size) {
  const float first = fmax(floor(low), 0.0f), last = fmin(ceil(high), (float)size - 1.0f);
  if (!(first <= last)) return (uint2)(1u, 0u);
  return (uint2)((uint)first / DPR_TILE, (uint)last / DPR_TILE);
}

/// Assembles the triangles. Dropped (orientation 0) is what reaches nearer than znear, lies wholly beyond zfar, has
/// exactly no area, reaches beyond DPR_MAX_NDC, or whose blurred bounds miss the image. One work-item per (view, face).
/// in   faces      uint4[face]             vertex indices; w = mesh
/// in   ndc        float4[view][vertex]
/// out  triangles  Triangle[view][face]
kernel void setup_forward(const FrameParams p, global const ViewParams* restrict views,
                          global const uint4* restrict faces, global const float4* restrict ndc,
                          global Triangle* restrict triangles) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.faces) return;
  const uint view = i / p.faces;
  const uint4 face = faces[i - view * p.faces];
  global const float4* vertices = ndc + view * p.vertices;
  const float3 a = vertices[face.x].xyz, b = vertices[face.y].xyz, c = vertices[face.z].xyz;

  const float nearest = fmin(fmin(a.z, b.z), c.z), furthest = fmax(fmax(a.z, b.z), c.z);
  // In pixels; a centre lies half a pixel from its corner.
  const float2 scale = (float2)(1.0f, -1.0f) / p.pixel_size;
  const float2 centre = 0.5f * (float2)((float)p.width, (float)p.height) - 0.5f;
  const float2 lowest = fmin(fmin(a.xy, b.xy), c.xy), highest = fmax(fmax(a.xy, b.xy), c.xy);
  const float2 low = lowest - p.blur_distance, high = highest + p.blur_distance;
  const uint2 columns = tile_range(low.x * scale.x + centre.x, high.x * scale.x + centre.x, p.width);
  const uint2 rows = tile_range(high.y * scale.y + centre.y, low.y * scale.y + centre.y, p.height);

  // Written so that a NaN fails.
  const float znear = views[view].znear;
  const float2 reach = fmax(fabs(lowest), fabs(highest));
  const int in_range = fabs(a.x + a.y + b.x + b.y + c.x + c.y) < INFINITY && fmax(reach.x, reach.y) < DPR_MAX_NDC;
  const int in_view = a.z >= znear && b.z >= znear && c.z >= znear && nearest < views[view].zfar &&
                      furthest < INFINITY && columns.x <= columns.y && rows.x <= rows.y;
  Triangle t;
  t.x0 = a.x;
  t.y0 = a.y;
  t.x1 = b.x;
  t.y1 = b.y;
  t.x2 = c.x;
  t.y2 = c.y;
  t.z0 = a.z;
  t.z1 = b.z;
  t.z2 = c.z;
  t.orientation = in_range && in_view ? (float)side_of_line(a.xy, b.xy, c.xy) : 0.0f;
  t.first_tile = columns.x | rows.x << 16;
  t.last_tile = columns.y | rows.y << 16;
  triangles[i] = t;
}
