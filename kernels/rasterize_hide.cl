// What nothing is seen of, because something opaque lies in front of it, further away than the noise of
// depths reaches: taken out of the coverage before there are fragments of it. For triangles that cover what
// they own and nothing else: all of them are opaque.
#include "rasterize.h"

/// Of a depth: rounding puts fragments that much beside the range of their triangle's corners.
#define DPR_DEPTH_ROUNDING 1e-6f

/// Vectors of samples in a tile.
#define DPR_TILE_VECTORS (DPR_TILE * DPR_TILE / DPR_WIDTH)

/// The samples of a tile that several pairs cover.
static inline ulong shared_samples(uint first, uint last, global const uint2* restrict masks) {
  ulong covered = 0, several = 0;
  for (uint pair = first; pair < last; ++pair) {
    const ulong mask = whole_mask(masks[pair]);
    several |= covered & mask;
    covered |= mask;
  }
  return several;
}

/// The first vector of samples that has a bit, which is taken out of the rest.
static inline uint next_vector(ulong* rest) {
  const uint v = (uint)(63 - clz(*rest & -*rest)) / DPR_WIDTH;
  *rest &= ~((((ulong)1 << DPR_WIDTH) - 1) << (v * DPR_WIDTH));
  return v;
}

/// The bits of a vector of samples, and as lanes of truth.
static inline uint vector_bits(ulong mask, uint v) {
  return (uint)(mask >> (v * DPR_WIDTH)) & ((1u << DPR_WIDTH) - 1);
}
static inline intn bit_lanes(uint bits) {
  return -convert_intn(((uintn)(bits) >> convert_uintn(DPR_LANE_INDEX)) & 1u);
}

/// Takes the samples at which a pair is hidden out of its mask. A fragment's depth is not beyond those of its
/// triangle's corners, nor is that of what is left of a clipped one; so the corners' say what lies behind
/// what. The front of a sample is never hidden. One work-item per tile of all views: few tiles have samples
/// that several pairs cover. Deterministic.
/// in      reach        normalised depth: what lies further behind something opaque is not seen
/// in      views        ViewParams[view]
/// in      tile_starts  uint[view * tile + 1]  runs of pairs
/// in      triangles, pair_face  as rasterize_cover
/// in      places       uint[pair]             where a pair's face lists it
/// in out  masks, counts  as rasterize_cover and clip_cover leave them
/// in out  face_pairs   uint[place]            the pairs of every face; DPR_NO_PAIR where nothing is seen of
///                                             one: what is gathered need not look at it
kernel void rasterize_hide(const FrameParams p, const float reach, global const ViewParams* restrict views,
                           global const uint* restrict tile_starts, global const Triangle* restrict triangles,
                           global const uint* restrict pair_face, global const uint* restrict places,
                           global uint2* restrict masks, global uint* restrict counts,
                           global uint* restrict face_pairs) {
  const uint tile = (uint)get_global_id(0), tiles = p.tiles_x * p.tiles_y;
  if (tile >= p.views * tiles) return;
  const uint first = tile_starts[tile], last = tile_starts[tile + 1];
  const ulong several = shared_samples(first, last, masks);
  if (several == 0) return;
  // The depth behind which nothing is seen of a sample: that of the pair whose furthest corner is nearest.
  const float reach_in_view = reach / views[tile / tiles].inverse_range;
  realn end[DPR_TILE_VECTORS];
  for (uint v = 0; v < DPR_TILE_VECTORS; ++v) end[v] = INFINITY;
  for (uint pair = first; pair < last; ++pair) {
    const ulong mask = whole_mask(masks[pair]) & several;
    if (mask == 0) continue;
    global const Triangle* t = triangles + pair_face[pair];
    const float furthest = fmax(fmax(t->z0, t->z1), t->z2);
    const float hides_from = furthest * (1.0f + DPR_DEPTH_ROUNDING) + reach_in_view;
    for (ulong rest = mask; rest != 0;) {
      const uint v = next_vector(&rest);
      end[v] = choose(bit_lanes(vector_bits(mask, v)), lesser(end[v], hides_from), end[v]);
    }
  }
  for (uint pair = first; pair < last; ++pair) {
    const ulong whole = whole_mask(masks[pair]), mask = whole & several;
    if (mask == 0) continue;
    global const Triangle* t = triangles + pair_face[pair];
    const float nearest = fmin(fmin(t->z0, t->z1), t->z2);
    ulong hidden = 0;
    for (ulong rest = mask; rest != 0;) {
      const uint v = next_vector(&rest);
      hidden |= (ulong)lane_bits(nearest > end[v]) << (v * DPR_WIDTH);
    }
    const ulong seen = whole & ~(hidden & mask);
    if (seen == whole) continue;
    masks[pair] = (uint2)((uint)seen, (uint)(seen >> 32));
    counts[pair] = (uint)popcount(seen);
    if (seen == 0) face_pairs[places[pair]] = DPR_NO_PAIR;
  }
}
