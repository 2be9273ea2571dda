// (tile, triangle) pairs: counted, then listed in face order, sorted by tile (sort.cl), then linked. Pairs are numbered
// by tile, so that what belongs to a tile lies together; faces list theirs, so that gradients are gathered in order.
// The host launches for the capacity of the buffers; only the device knows how many pairs there are. Pairs that exceed
// the capacity are all left out, and the host, which reads the count later, starts over.
#include "shared_types.h"

/// Slack of the overlap test, NDC: what rounding can move a pixel centre across a blurred edge; and what it can besides,
/// of the largest coordinate.
#define DPR_BIN_SLACK 1e-5f
#define DPR_BIN_RELATIVE_SLACK 2e-6f

/// False only if no pixel centre of the tile is within the blur distance of the triangle. Either one of the edges, pushed
/// out by the blur, has the whole tile outside; or a vertex v is the triangle's nearest point: with n from v to the
/// nearest point of the tile, further than the blur, and dot(n, y - v) <= 0 for the other vertices y, every point x of
/// the tile has dot(n, x - y) >= |n|^2, hence |x - y| >= |n|.
static inline int tile_overlaps(const FrameParams p, const Triangle t, uint tile_x, uint tile_y) {
  const float half_extent = 0.5f * (DPR_TILE - 1) * p.pixel_size;
  const float cx = ((float)(tile_x * DPR_TILE) + 0.5f * DPR_TILE - 0.5f * (float)p.width) * p.pixel_size;
  const float cy = (0.5f * (float)p.height - (float)(tile_y * DPR_TILE) - 0.5f * DPR_TILE) * p.pixel_size;
  const float4 ax = (float4)(t.x0, t.x1, t.x2, 0.0f), ay = (float4)(t.y0, t.y1, t.y2, 0.0f);
  const float4 ex = ax.yzxw - ax, ey = ay.yzxw - ay;
  const float4 inside = (ex * (cy - ay) - ey * (cx - ax)) * t.orientation;
  const float4 reach = half_extent * (fabs(ex) + fabs(ey));
  const float4 far = fmax(fmax(fabs(ax), fabs(ay)), fmax(fabs(cx), fabs(cy)));
  const float blur = p.blur_distance + DPR_BIN_SLACK + DPR_BIN_RELATIVE_SLACK * fmax(fmax(far.x, far.y), far.z);
  if (any((inside + reach < -blur * sqrt(ex * ex + ey * ey)).xyz)) return 0;
  const float4 nx = clamp(ax, cx - half_extent, cx + half_extent) - ax;
  const float4 ny = clamp(ay, cy - half_extent, cy + half_extent) - ay;
  const int4 behind = nx * ex + ny * ey <= 0.0f && nx * ex.zxyw + ny * ey.zxyw >= 0.0f;
  return !any((behind && nx * nx + ny * ny > blur * blur).xyz);
}

/// Whether a tile within the triangle's bounds is listed for it; always where there is but one.
static inline int is_listed(const FrameParams p, const Triangle t, uint tile_x, uint tile_y) {
  return t.first_tile == t.last_tile || tile_overlaps(p, t, tile_x, tile_y);
}

/// Counts the pairs of every triangle. One work-item per (view, face).
/// in   triangles  Triangle[view][face]
/// out  counts  uint[view][face]
kernel void bin_count(const FrameParams p, global const Triangle* restrict triangles, global uint* restrict counts) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.faces) return;
  const Triangle t = triangles[i];
  uint count = 0;
  if (t.orientation != 0.0f) {
    for (uint y = t.first_tile >> 16; y <= t.last_tile >> 16; ++y) {
      for (uint x = t.first_tile & 0xffffu; x <= (t.last_tile & 0xffffu); ++x) count += is_listed(p, t, x, y) ? 1 : 0;
    }
  }
  counts[i] = count;
}

/// Lists the tiles of every triangle, each at a place of its own. One work-item per (view, face).
/// in   triangles   Triangle[view][face]
/// in   capacity    places that there are
/// in   offsets     uint[view * face + 1]  exclusive scan of the counts
/// out  pairs       uint[1]               how many there are; 0 where they do not fit
/// out  place_face  uint[place]           view * faces + face
/// out  place_tile  uint[place]           view * tiles + tile
/// out  places      uint[place]           the place itself: what sorting permutes
kernel void bin_fill(const FrameParams p, const uint capacity, global const Triangle* restrict triangles,
                     global const uint* restrict offsets, global uint* restrict pairs,
                     global uint* restrict place_face, global uint* restrict place_tile,
                     global uint* restrict places) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.faces) return;
  const uint total = offsets[p.views * p.faces];
  if (i == 0) pairs[0] = total > capacity ? 0 : total;
  if (total > capacity) return;
  if (offsets[i] == offsets[i + 1]) return;
  const Triangle t = triangles[i];
  const uint first_tile = i / p.faces * p.tiles_x * p.tiles_y;
  uint place = offsets[i];
  for (uint y = t.first_tile >> 16; y <= t.last_tile >> 16; ++y) {
    for (uint x = t.first_tile & 0xffffu; x <= (t.last_tile & 0xffffu); ++x) {
      if (!is_listed(p, t, x, y)) continue;
      place_face[place] = i;
      place_tile[place] = first_tile + y * p.tiles_x + x;
      places[place] = place;
      ++place;
    }
  }
}

/// Links pairs, numbered by tile, and the places where faces list theirs. One work-item for every pair within the
/// capacity.
/// in   pairs       uint[1]
/// in   places      uint[pair]   where the pair's face lists it
/// in   place_face  uint[place]
/// out  pair_face   uint[capacity]  view * faces + face; 0 where there is no pair
/// out  face_pairs  uint[place]  the pairs of every face, by tile
kernel void bin_link(const uint capacity, global const uint* restrict pairs, global const uint* restrict places,
                     global const uint* restrict place_face, global uint* restrict pair_face,
                     global uint* restrict face_pairs) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= capacity) return;
  if (pair >= pairs[0]) {
    pair_face[pair] = 0;
    return;
  }
  pair_face[pair] = place_face[places[pair]];
  face_pairs[places[pair]] = pair;
}
