// What fragments see of texels, sorted by cell, and a texel's sum of it: by tile, in order, and tiles in order.
// As bands consist of whole tiles, sums do not depend on bands, nor on how many work-items share the tiles.
#ifndef DPR_TEXEL_RUNS_H
#define DPR_TEXEL_RUNS_H

#include "pyramid.h"

#ifndef DPR_LANES
#define DPR_LANES 8 /* as lanes.h */
#endif

/// Places of fragments, sorted by cell, as surface_list and surface_place leave them. On GPUs also the tile of every
/// sorted place, and sums of tiles' fragments in a cell, as texels_runs leaves them.
typedef struct {
  global const uint* numbers;
  global const SeenTexels* at;
  global const uint* tiles;
  global const float4* sums;
} SeenList;

static inline uint tile_at(const SeenList seen, uint place) {
#if DPR_LANES == 1
  return seen.tiles[place];
#else
  return seen.at[seen.numbers[place]].tile;
#endif
}

/// What is left to add to a texel: runs of places in its four cells, in which it is the cell's own texel, the
/// one to the right, the one below, and the one below that.
typedef struct {
  uint first[4], last[4];
} TexelRuns;

static inline TexelRuns texel_runs(const Level l, uint i, global const uint* starts) {
  const uint x = i % l.width, y = i / l.width;
  const uint left = x == 0 ? l.width - 1 : x - 1, above = y == 0 ? l.height - 1 : y - 1;
  const uint cells[4] = {y * l.width + x, y * l.width + left, above * l.width + x, above * l.width + left};
  TexelRuns r;
#pragma unroll
  for (uint k = 0; k < 4; ++k) {
    r.first[k] = starts[l.first + cells[k]];
    r.last[k] = starts[l.first + cells[k] + 1];
  }
  return r;
}

#define DPR_NO_TILE 0xffffffffu

/// The first tile that is left; DPR_NO_TILE where none is.
static inline uint first_tile(const SeenList seen, const TexelRuns r) {
  uint tile = DPR_NO_TILE;
#pragma unroll
  for (uint k = 0; k < 4; ++k)
    if (r.first[k] < r.last[k]) tile = min(tile, tile_at(seen, r.first[k]));
  return tile;
}

/// What the texel whose k-th cell it is gets of a fragment's gradient.
static inline float3 texel_share(uint k, float3 grad, float right, float below) {
  const float3 lower = below * grad;
  return (k % 2 ? right : 1.0f - right) * (k / 2 ? lower : grad - lower);
}

/// The sum over a tile; the runs go on behind it.
static inline float3 take_tile(const SeenList seen, uint tile, TexelRuns* r) {
  float3 total = 0.0f;
#pragma unroll
  for (uint k = 0; k < 4; ++k) {
    const uint last = r->last[k];
    uint place = r->first[k];
    float3 sum = 0.0f;
#if DPR_LANES == 1
    const uint behind = place + DPR_TEXEL_RUN;
    if (behind < last && seen.tiles[place] == tile && seen.tiles[behind] == tile) {
      const float4 known = seen.sums[4 * (place / DPR_TEXEL_RUN) + k];
      sum = known.xyz;
      r->first[k] = as_uint(known.w);
      total += sum;
      continue;
    }
#endif
    for (; place < last; ++place) {
#if DPR_LANES == 1
      if (seen.tiles[place] != tile) break;
#endif
      const SeenTexels at = seen.at[seen.numbers[place]];
      if (at.tile != tile) break;
      sum += texel_share(k, (float3)(at.red, at.green, at.blue), at.right, at.below);
    }
    r->first[k] = place;
    total += sum;
  }
  return total;
}

#if DPR_LANES == 1

/// Leaves out what lies before a tile.
static inline void skip_to(const SeenList seen, uint tile, TexelRuns* r) {
#pragma unroll
  for (uint k = 0; k < 4; ++k) {
    uint low = r->first[k], high = r->last[k];
    while (low < high) {
      const uint middle = low + (high - low) / 2;
      if (tile_at(seen, middle) < tile) {
        low = middle + 1;
      } else {
        high = middle;
      }
    }
    r->first[k] = low;
  }
}

#endif

/// Whether the texel is a whole group's. None is on a CPU.
static inline int is_shared(const TexelRuns r) {
  uint places = 0;
#pragma unroll
  for (uint k = 0; k < 4; ++k) places = add_sat(places, r.last[k] - r.first[k]);
  return DPR_LANES == 1 && places > DPR_SHARED_TEXEL;
}

#endif
