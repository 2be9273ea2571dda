// (tile, triangle) pairs in face order: counted, then listed. sort.cl orders them by tile.
#include "shared_types.h"

/// Slack of the overlap test, NDC: what rounding can move a pixel centre across a blurred edge.
#define DPR_BIN_SLACK 1e-5f

/// False only if no pixel centre of the tile is within the blur distance of the triangle: one of the edges, pushed
/// out by the blur, has the whole tile outside.
static inline int tile_overlaps(const FrameParams p, const Triangle t, uint tile_x, uint tile_y) {
  const float half_extent = 0.5f * (DPR_TILE - 1) * p.pixel_size;
  const float cx = ((float)(tile_x * DPR_TILE) + 0.5f * DPR_TILE - 0.5f * (float)p.width) * p.pixel_size;
  const float cy = (0.5f * (float)p.height - (float)(tile_y * DPR_TILE) - 0.5f * DPR_TILE) * p.pixel_size;
  const float4 ax = (float4)(t.x0, t.x1, t.x2, 0.0f), ay = (float4)(t.y0, t.y1, t.y2, 0.0f);
  const float4 ex = ax.yzxw - ax, ey = ay.yzxw - ay;
  const float4 inside = (ex * (cy - ay) - ey * (cx - ax)) * t.orientation;
  const float4 reach = half_extent * (fabs(ex) + fabs(ey));
  const float4 blur = (p.blur_distance + DPR_BIN_SLACK) * sqrt(ex * ex + ey * ey);
  return !any((inside + reach < -blur).xyz);
}

/// Counts the pairs of every triangle. One work-item per (view, face).
/// out  counts  uint[view][face]
kernel void bin_count(const FrameParams p, global const Triangle* restrict triangles, global uint* restrict counts) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.faces) return;
  const Triangle t = triangles[i];
  uint count = 0;
  if (t.orientation != 0.0f) {
    for (uint y = t.first_tile >> 16; y <= t.last_tile >> 16; ++y) {
      for (uint x = t.first_tile & 0xffffu; x <= (t.last_tile & 0xffffu); ++x) count += tile_overlaps(p, t, x, y) ? 1 : 0;
    }
  }
  counts[i] = count;
}

/// Lists the pairs of every triangle. One work-item per (view, face).
/// in   offsets    uint[view * face + 1]  exclusive scan of the counts
/// out  pair_face  uint[pair]             view * faces + face
/// out  pair_tile  uint[pair]             view * tiles + tile
/// out  order      uint[pair]             the pair itself: what sorting permutes
kernel void bin_fill(const FrameParams p, global const Triangle* restrict triangles,
                     global const uint* restrict offsets, global uint* restrict pair_face,
                     global uint* restrict pair_tile, global uint* restrict order) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.faces) return;
  const Triangle t = triangles[i];
  if (t.orientation == 0.0f) return;
  const uint first_tile = i / p.faces * p.tiles_x * p.tiles_y;
  uint pair = offsets[i];
  for (uint y = t.first_tile >> 16; y <= t.last_tile >> 16; ++y) {
    for (uint x = t.first_tile & 0xffffu; x <= (t.last_tile & 0xffffu); ++x) {
      if (!tile_overlaps(p, t, x, y)) continue;
      pair_face[pair] = i;
      pair_tile[pair] = first_tile + y * p.tiles_x + x;
      order[pair] = pair;
      ++pair;
    }
  }
}
