// Triangles of a view: assembled from projected vertices, culled, bounded.
#include "ownership.h"
#include "shared_types.h"

/// Corners further away than this, NDC, have squared distances that single precision does not hold.
#define DPR_MAX_NDC 1e18f

/// Whether [low, high], pixels, comes within a pixel of the image along one axis. Written so that a NaN does not.
static inline int meets_image(float low, float high, uint size) { return high > -1.0f && low < (float)size; }

/// The tiles along one axis that have samples within [low, high], pixels; first > last if there is none.
static inline uint2 tile_range(float low, float high, uint size) {
  const float first = fmax(ceil(low - DPR_BOUNDS_SLACK), 0.0f);
  const float last = fmin(floor(high + DPR_BOUNDS_SLACK), (float)size - 1.0f);
  if (!(first <= last)) return (uint2)(1u, 0u);
  return (uint2)((uint)first / DPR_TILE, (uint)last / DPR_TILE);
}

/// Assembles the triangles. Dropped (orientation 0) is what reaches nearer than znear, lies wholly beyond zfar, has
/// exactly no area, reaches beyond DPR_MAX_NDC, cannot be seen, or whose blurred bounds miss the image. What is kept but
/// has no sample within its bounds has no tiles. One work-item per (view, face).
/// in   views      ViewParams[view]
/// in   faces      uint4[face]             vertex indices; w = mesh
/// in   ndc        float4[view][vertex]
/// in   hidden     float[view][mesh]       the orientation of faces that nothing can see; 0: all may be seen
/// out  triangles  Triangle[view][face]
kernel void setup_forward(const FrameParams p, global const ViewParams* restrict views,
                          global const uint4* restrict faces, global const float4* restrict ndc,
                          global const float* restrict hidden, global Triangle* restrict triangles) {
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
  const float left = low.x * scale.x + centre.x, right = high.x * scale.x + centre.x;
  const float top = high.y * scale.y + centre.y, bottom = low.y * scale.y + centre.y;
  const uint2 columns = tile_range(left, right, p.width), rows = tile_range(top, bottom, p.height);

  // Written so that a NaN fails.
  const float znear = views[view].znear;
  const float2 reach = fmax(fabs(lowest), fabs(highest));
  const int in_range = fabs(a.x + a.y + b.x + b.y + c.x + c.y) < INFINITY && fmax(reach.x, reach.y) < DPR_MAX_NDC;
  const int in_view = a.z >= znear && b.z >= znear && c.z >= znear && nearest < views[view].zfar &&
                      furthest < INFINITY && meets_image(left, right, p.width) &&
                      meets_image(top, bottom, p.height);
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
  if (t.orientation == hidden[view * p.meshes + face.w]) t.orientation = 0.0f;
  t.first_tile = columns.x | rows.x << 16;
  t.last_tile = columns.y | rows.y << 16;
  triangles[i] = t;
}
