// Takes samples out of the coverage that lie behind something opaque, further away than the noise of depths
// reaches, before there are fragments of them. For triangles that cover what
// they own and nothing else: all of them are opaque. A tile is a work-item's on CPUs, a work-group's on
// GPUs.
#include "group.h"
#include "rasterize.h"

/// Error of a depth: rounding puts fragments that much beside the range of their triangle's corners.
#define DPR_DEPTH_ROUNDING 1e-6f

/// The depth behind which nothing is seen of what a triangle covers.
static inline float hides_from(global const Triangle* t, float reach) {
  return fmax(fmax(t->z0, t->z1), t->z2) * (1.0f + DPR_DEPTH_ROUNDING) + reach;
}
static inline float nearest_depth(global const Triangle* t) { return fmin(fmin(t->z0, t->z1), t->z2); }

/// Buffers of the pairs of a tile.
typedef struct {
  global const Triangle* triangles;
  global const uint *face, *places;
  global uint2* masks;
  global uint *counts, *face_pairs;
} TilePairs;

/// Leaves a pair, which covers `whole`, what is not hidden of it.
static inline void take_hidden(const TilePairs pairs, uint pair, ulong whole, ulong hidden) {
  const ulong seen = whole & ~hidden;
  if (seen == whole) return;
  pairs.masks[pair] = (uint2)((uint)seen, (uint)(seen >> 32));
  pairs.counts[pair] = (uint)popcount(seen);
  if (seen == 0) pairs.face_pairs[pairs.places[pair]] = DPR_NO_PAIR;
}

#if DPR_LANES == 1

/// The depth behind which nothing is seen of a sample: that of the pair whose furthest corner is nearest. The
/// group reads as many pairs at once as it has work-items.
static inline float hiding_depth(const TilePairs pairs, uint first, uint last, float reach, uint sample,
                                 local uint2* masks, local float* depths) {
  const uint item = (uint)get_local_id(0);
  float end = INFINITY;
  for (uint chunk = first; chunk < last; chunk += DPR_GROUP) {
    const uint count = min(last - chunk, (uint)DPR_GROUP);
    if (item < count) {
      masks[item] = pairs.masks[chunk + item];
      depths[item] = hides_from(pairs.triangles + pairs.face[chunk + item], reach);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint k = 0; k < count; ++k) end = whole_mask(masks[k]) >> sample & 1 ? lesser(end, depths[k]) : end;
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  return end;
}

/// Takes what is hidden out of the pairs of a tile. To be called by all of a group. `ends` has room for the
/// samples of a tile, `masks` and `depths` for the work-items.
static inline void hide(const TilePairs pairs, uint first, uint last, float reach, local uint2* masks,
                        local float* depths, local float* ends) {
  const uint item = (uint)get_local_id(0);
  for (uint sample = item; sample < DPR_TILE * DPR_TILE; sample += DPR_GROUP)
    ends[sample] = hiding_depth(pairs, first, last, reach, sample, masks, depths);
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint pair = first + item; pair < last; pair += DPR_GROUP) {
    const ulong whole = whole_mask(pairs.masks[pair]);
    const float nearest = nearest_depth(pairs.triangles + pairs.face[pair]);
    ulong hidden = 0;
    for (ulong rest = whole; rest != 0; rest &= rest - 1)
      hidden |= nearest > ends[63 - clz(rest & -rest)] ? rest & -rest : 0;
    take_hidden(pairs, pair, whole, hidden);
  }
}

#else

/// Vectors of samples in a tile.
#define DPR_TILE_VECTORS (DPR_TILE * DPR_TILE / DPR_WIDTH)

/// The samples of a tile that several pairs cover.
static inline ulong shared_samples(uint first, uint last, global const uint2* masks) {
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

/// Takes what is hidden out of the pairs of a tile: few tiles have samples that several pairs cover.
static inline void hide(const TilePairs pairs, uint first, uint last, float reach) {
  const ulong several = shared_samples(first, last, pairs.masks);
  if (several == 0) return;
  // The depth behind which nothing is seen of a sample: that of the pair whose furthest corner is nearest.
  realn end[DPR_TILE_VECTORS];
  for (uint v = 0; v < DPR_TILE_VECTORS; ++v) end[v] = INFINITY;
  for (uint pair = first; pair < last; ++pair) {
    const ulong mask = whole_mask(pairs.masks[pair]) & several;
    if (mask == 0) continue;
    const float depth = hides_from(pairs.triangles + pairs.face[pair], reach);
    for (ulong rest = mask; rest != 0;) {
      const uint v = next_vector(&rest);
      end[v] = choose(bit_lanes(vector_bits(mask, v)), lesser(end[v], depth), end[v]);
    }
  }
  for (uint pair = first; pair < last; ++pair) {
    const ulong whole = whole_mask(pairs.masks[pair]), mask = whole & several;
    if (mask == 0) continue;
    const float nearest = nearest_depth(pairs.triangles + pairs.face[pair]);
    ulong hidden = 0;
    for (ulong rest = mask; rest != 0;) {
      const uint v = next_vector(&rest);
      hidden |= (ulong)lane_bits(nearest > end[v]) << (v * DPR_WIDTH);
    }
    take_hidden(pairs, pair, whole, hidden & mask);
  }
}

#endif

/// Takes the samples at which a pair is hidden out of its mask. A fragment's depth is not beyond those of its
/// triangle's corners, nor is that of what is left of a clipped one; so the corners' say what lies behind
/// what. The front of a sample is never hidden. One work-item per tile of all views; on GPUs a work-group.
/// Deterministic.
/// in      reach        normalised depth: what lies further behind something opaque is not seen
/// in      views        ViewParams[view]
/// in      tile_starts  uint[view * tile + 1]  runs of pairs
/// in      triangles, pair_face  as rasterize_cover
/// in      places       uint[pair]             where a pair's face lists it
/// in out  masks, counts  as rasterize_cover and clip_cover leave them
/// in out  face_pairs   uint[place]            the pairs of every face; DPR_NO_PAIR where nothing is seen of
///                                             one: what is gathered need not look at it
DPR_SHARING_KERNEL kernel void rasterize_hide(
    const FrameParams p, const float reach, global const ViewParams* restrict views,
    global const uint* restrict tile_starts, global const Triangle* restrict triangles,
    global const uint* restrict pair_face, global const uint* restrict places, global uint2* restrict masks,
    global uint* restrict counts, global uint* restrict face_pairs) {
  const TilePairs pairs = {triangles, pair_face, places, masks, counts, face_pairs};
  const uint tiles = p.tiles_x * p.tiles_y;
#if DPR_LANES == 1
  local uint2 covered[DPR_GROUP];
  local float depths[DPR_GROUP], ends[DPR_TILE * DPR_TILE];
  const uint tile = (uint)get_group_id(0), first = tile_starts[tile], last = tile_starts[tile + 1];
  if (last - first < 2) return;  // all of the group: what is alone in a tile hides nothing
  hide(pairs, first, last, reach / views[tile / tiles].inverse_range, covered, depths, ends);
#else
  const uint tile = (uint)get_global_id(0);
  if (tile >= p.views * tiles) return;
  hide(pairs, tile_starts[tile], tile_starts[tile + 1], reach / views[tile / tiles].inverse_range);
#endif
}
