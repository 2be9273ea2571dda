// The samples and tiles that an extent on the raster holds, and those that are listed for a triangle.
#ifndef DPR_TILES_H
#define DPR_TILES_H

#include "ownership.h"
#include "shared_types.h"

/// The place of the lowest bit that is set.
static inline uint lowest_bit(uint bits) { return 31 - clz(bits & -bits); }

/// Slack of the overlap test, NDC: what rounding can move a pixel centre across a blurred edge; and what it
/// can besides, of the largest coordinate.
#define DPR_BIN_SLACK 1e-5f
#define DPR_BIN_RELATIVE_SLACK 2e-6f

/// Most samples of a tile, within the bounds of a triangle without blur, whose ownership is found out at
/// once: that takes less than a pair that covers nothing.
#define DPR_FEW_SAMPLES 2

/// The samples [x, y] along one axis within [low, high], in samples; x > y, and so for their tiles, if there
/// is none. By conversions: PoCL's ceil() and floor() branch.
static inline uint2 samples_within(float low, float high, uint size) {
  const float from = fmin(fmax(low - DPR_BOUNDS_SLACK, 0.0f), (float)size);
  const float to = fmin(high + DPR_BOUNDS_SLACK, (float)size - 1.0f);
  const uint truncated = (uint)from, last = (uint)fmax(to, 0.0f);
  const uint first = truncated + ((float)truncated < from ? 1 : 0);
  const int is_none = !(to >= 0.0f) || first > last;
  return (uint2)(is_none ? DPR_TILE : first, is_none ? 0 : last);
}

/// The columns or rows [x, y] of a triangle's bounds.
static inline uint2 columns_of(const Triangle t) {
  return (uint2)(t.first_sample & 0xffffu, t.last_sample & 0xffffu);
}
static inline uint2 rows_of(const Triangle t) { return (uint2)(t.first_sample >> 16, t.last_sample >> 16); }

/// Those of a tile's samples [x, y] along one axis that are within others.
static inline uint2 samples_of_tile(uint2 samples, uint tile) {
  return (uint2)(max(samples.x, tile * DPR_TILE), min(samples.y, tile * DPR_TILE + DPR_TILE - 1));
}

/// False only if no pixel centre of the tile is within the blur distance of the triangle. Either one of the
/// edges, pushed out by the blur, has the whole tile outside; or a vertex v is the triangle's nearest point:
/// with n from v to the nearest point of the tile, further than the blur, and dot(n, y - v) <= 0 for the
/// other vertices y, every point x of the tile has dot(n, x - y) >= |n|^2, hence |x - y| >= |n|.
static inline int tile_overlaps(const FrameParams p, const Triangle t, uint tile_x, uint tile_y) {
  const float half_extent = 0.5f * (DPR_TILE - 1) * p.pixel_size;
  const float cx = ((float)(tile_x * DPR_TILE) + 0.5f * DPR_TILE - 0.5f * (float)p.width) * p.pixel_size;
  const float cy = (0.5f * (float)p.height - (float)(tile_y * DPR_TILE) - 0.5f * DPR_TILE) * p.pixel_size;
  const float4 ax = (float4)(t.x0, t.x1, t.x2, 0.0f), ay = (float4)(t.y0, t.y1, t.y2, 0.0f);
  const float4 ex = ax.yzxw - ax, ey = ay.yzxw - ay;
  const float4 inside = (ex * (cy - ay) - ey * (cx - ax)) * t.orientation;
  const float4 reach = half_extent * (fabs(ex) + fabs(ey));
  const float4 far = fmax(fmax(fabs(ax), fabs(ay)), fmax(fabs(cx), fabs(cy)));
  const float blur =
      p.blur_distance + DPR_BIN_SLACK + DPR_BIN_RELATIVE_SLACK * fmax(fmax(far.x, far.y), far.z);
  if (any((inside + reach < -blur * sqrt(ex * ex + ey * ey)).xyz)) return 0;
  const float4 nx = clamp(ax, cx - half_extent, cx + half_extent) - ax;
  const float4 ny = clamp(ay, cy - half_extent, cy + half_extent) - ay;
  const int4 behind = nx * ex + ny * ey <= 0.0f && nx * ex.zxyw + ny * ey.zxyw >= 0.0f;
  return !any((behind && nx * nx + ny * ny > blur * blur).xyz);
}

static inline int owns_any(const FrameParams p, const Triangle t, uint2 columns, uint2 rows) {
  for (uint row = rows.x; row <= rows.y; ++row) {
    for (uint column = columns.x; column <= columns.y; ++column) {
      if (owns_sample(t, pixel_centre(p, (int)column, (int)row))) return 1;
    }
  }
  return 0;
}

/// True if a tile that the triangle's bounds meet is listed for it.
static inline int is_listed(const FrameParams p, const Triangle t, uint tile_x, uint tile_y) {
  const uint2 columns = samples_of_tile(columns_of(t), tile_x), rows = samples_of_tile(rows_of(t), tile_y);
  const uint samples = (columns.y - columns.x + 1) * (rows.y - rows.x + 1);
  if (p.blur_distance == 0.0f && samples <= DPR_FEW_SAMPLES) return owns_any(p, t, columns, rows);
  const uint2 all_columns = columns_of(t) / DPR_TILE, all_rows = rows_of(t) / DPR_TILE;
  const int is_only = all_columns.x == all_columns.y && all_rows.x == all_rows.y;
  return is_only || tile_overlaps(p, t, tile_x, tile_y);
}

/// Number of tiles that a triangle's bounds hold in rows [x, y] of tiles, and in all.
static inline uint tiles_of_rows(const Triangle t, uint2 rows) {
  const uint2 columns = columns_of(t) / DPR_TILE;
  return (columns.y + 1 - columns.x) * (rows.y + 1 - rows.x);
}
static inline uint tiles_of_bounds(const Triangle t) { return tiles_of_rows(t, rows_of(t) / DPR_TILE); }

/// Number of tiles of rows [x, y] that are listed for a triangle.
static inline uint count_tiles(const FrameParams p, const Triangle t, uint2 rows) {
  const uint2 columns = columns_of(t) / DPR_TILE;
  uint count = 0;
  for (uint y = rows.x; y <= rows.y; ++y) {
    for (uint x = columns.x; x <= columns.y; ++x) count += is_listed(p, t, x, y) ? 1 : 0;
  }
  return count;
}

/// Tiles from which on a work-group of a GPU shares a triangle, by rows: the others would wait for the one
/// work-item that has it.
#define DPR_SHARED_TILES 64
static inline int is_shared(const Triangle t) {
  return DPR_LANES == 1 && tiles_of_bounds(t) >= DPR_SHARED_TILES;
}

/// The rows of tiles [x, y] of a shared triangle that a work-item has; x = y + 1 if none.
static inline uint2 shared_rows(const Triangle t) {
  const uint2 rows = rows_of(t) / DPR_TILE;
  const uint each = (rows.y - rows.x + DPR_GROUP) / DPR_GROUP, end = rows.y + 1;
  const uint first = min(rows.x + (uint)get_local_id(0) * each, end);
  return (uint2)(first, min(first + each, end) - 1);
}

#endif
