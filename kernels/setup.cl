// Triangles of a view: assembled from projected vertices, culled, bounded.
#include "shared_types.h"

/// The tiles along one axis that [low, high] (pixels, clipped to the image) touches; first > last if none.
static inline uint2 tile_range(float low, float high, uint size) {
  const float first = max(floor(low), 0.0f), last = min(ceil(high), (float)size - 1.0f);
  if (!(first <= last)) return (uint2)(1u, 0u);
  return (uint2)((uint)first / DPR_TILE, (uint)last / DPR_TILE);
}

/// Assembles the triangles. Dropped (orientation 0) is what reaches nearer than znear, lies wholly beyond zfar, has no
/// area, is not finite, or whose blurred bounds miss the image. One work-item per (view, face).
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

  const float area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
  const float nearest = min(min(a.z, b.z), c.z), furthest = max(max(a.z, b.z), c.z);
  // In pixels; a centre lies half a pixel from its corner.
  const float2 scale = (float2)(1.0f, -1.0f) / p.pixel_size;
  const float2 centre = 0.5f * (float2)((float)p.width, (float)p.height) - 0.5f;
  const float2 low = min(min(a.xy, b.xy), c.xy) - p.blur_distance;
  const float2 high = max(max(a.xy, b.xy), c.xy) + p.blur_distance;
  const uint2 columns = tile_range(low.x * scale.x + centre.x, high.x * scale.x + centre.x, p.width);
  const uint2 rows = tile_range(high.y * scale.y + centre.y, low.y * scale.y + centre.y, p.height);

  // Written so that a NaN fails.
  const float znear = views[view].znear;
  const int kept = fabs(area) > DPR_MIN_AREA && fabs(area) < INFINITY && a.z >= znear && b.z >= znear && c.z >= znear &&
                   nearest < views[view].zfar && furthest < INFINITY && columns.x <= columns.y && rows.x <= rows.y;
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
  t.orientation = kept ? copysign(1.0f, area) : 0.0f;
  t.first_tile = columns.x | rows.x << 16;
  t.last_tile = columns.y | rows.y << 16;
  triangles[i] = t;
}
