// The smaller levels of textures; and gradients of texels, gathered from the four cells that have them. A
// texel's fragments are added up by tile, in order, and tiles in order: as bands consist of whole tiles, the
// sums do not depend on bands, nor on how many work-items share the tiles. No atomics.
#include "group.h"
#include "pyramid.h"

/// Places of fragments, sorted by cell, as surface_list and surface_place leave them.
typedef struct {
  global const uint* numbers;
  global const SeenTexels* at;
} SeenList;

static inline uint tile_at(const SeenList seen, uint place) { return seen.at[seen.numbers[place]].tile; }

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

/// The sum over a tile; the runs go on behind it.
static inline float3 take_tile(const SeenList seen, uint tile, TexelRuns* r) {
  float3 total = 0.0f;
#pragma unroll
  for (uint k = 0; k < 4; ++k) {
    const uint last = r->last[k];
    uint place = r->first[k];
    float3 sum = 0.0f;
    for (; place < last; ++place) {
      const SeenTexels at = seen.at[seen.numbers[place]];
      if (at.tile != tile) break;
      const float3 grad = (float3)(at.red, at.green, at.blue), lower = at.below * grad;
      sum += (k % 2 ? at.right : 1.0f - at.right) * (k / 2 ? lower : grad - lower);
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

/// Whether the texel is a whole group's.
static inline int is_long(const TexelRuns r) {
  uint places = 0;
#pragma unroll
  for (uint k = 0; k < 4; ++k) places = add_sat(places, r.last[k] - r.first[k]);
  return places > DPR_RUN_CHUNK;
}

#endif

/// Adds a band's fragments to the gradients of a level's texels. One work-item per texel of it; on GPUs
/// texels of many fragments are a group's, a work-item a tile. Deterministic.
/// in   number    the texture's
/// in   level     of its pyramid
/// in   textures  Texture[texture]
/// in   starts    uint[cell + 1]    runs of `numbers`; a cell for every texel of all textures
/// in   numbers   uint[...]         places of fragments, by cell
/// in   places    SeenTexels[...]   as surface_list and surface_place leave them
/// in out  grad   float4[texel]     of all textures; w stays
DPR_SHARING_KERNEL kernel void texels_sum(const uint number, const uint level,
                                          global const Texture* restrict textures,
                                          global const uint* restrict starts,
                                          global const uint* restrict numbers,
                                          global const SeenTexels* restrict places,
                                          global float4* restrict grad) {
  const uint i = (uint)get_global_id(0);
  const Level l = find_level(textures[number], level);
  const SeenList seen = {numbers, places};
  TexelRuns r = {{0}, {0}};
  if (i < l.width * l.height) r = texel_runs(l, i, starts);
#if DPR_LANES == 1
  local uint shared[DPR_GROUP], sums[DPR_GROUP];
  local float tile_sums[3 * DPR_GROUP];
  const uint item = (uint)get_local_id(0), last = group_collect(is_long(r), i, shared, sums);
  for (uint k = 0; k < last; ++k) {
    const uint texel = shared[k];
    TexelRuns left = texel_runs(l, texel, starts);
    global float* const out = (global float*)(grad + l.first + texel);
    float sum = item < 3 ? out[item] : 0.0f;
    for (uint tile = first_tile(seen, left); tile != DPR_NO_TILE; tile = first_tile(seen, left)) {
      TexelRuns own = left;
      skip_to(seen, tile + item, &own);
      vstore3(take_tile(seen, tile + item, &own), item, tile_sums);
      barrier(CLK_LOCAL_MEM_FENCE);
      if (item < 3)
        for (uint j = 0; j < DPR_GROUP; ++j) sum += tile_sums[3 * j + item];
      barrier(CLK_LOCAL_MEM_FENCE);
      skip_to(seen, tile + DPR_GROUP, &left);
    }
    if (item < 3) out[item] = sum;
  }
  if (is_long(r)) return;
#endif
  uint tile = first_tile(seen, r);
  if (tile == DPR_NO_TILE) return;
  float3 sum = grad[l.first + i].xyz;
  for (; tile != DPR_NO_TILE; tile = first_tile(seen, r)) sum += take_tile(seen, tile, &r);
  grad[l.first + i].xyz = sum;
}

/// Texels of a level from those of the one before. One work-item per texel of it. Deterministic.
/// in   number    the texture's
/// in   level     1 or more
/// in   textures  Texture[texture]
/// in out  texels  float4[texel]  linear RGB
kernel void texels_shrink(const uint number, const uint level, global const Texture* restrict textures,
                          global float4* restrict texels) {
  const uint i = (uint)get_global_id(0);
  const Level small = find_level(textures[number], level), large = find_level(textures[number], level - 1);
  if (i >= small.width * small.height) return;
  const uint column = i % small.width, row = i / small.width;
  float4 sum = 0.0f;
  for (uint y = row * large.height / small.height; y < large.height; ++y) {
    const float part_y = covered_part(row, small.height, y, large.height);
    if (part_y == 0.0f) break;
    for (uint x = column * large.width / small.width; x < large.width; ++x) {
      const float part_x = covered_part(column, small.width, x, large.width);
      if (part_x == 0.0f) break;
      sum += part_x * part_y * texels[large.first + y * large.width + x];
    }
  }
  texels[small.first + i] = sum;
}

/// Adds the gradients of a level's texels to those of the level before. One work-item per texel of that.
/// Deterministic.
/// in   number    the texture's
/// in   level     1 or more: the one whose gradients are known
/// in   textures  Texture[texture]
/// in out  grad   float4[texel]
kernel void texels_shrink_backward(const uint number, const uint level,
                                   global const Texture* restrict textures, global float4* restrict grad) {
  const uint i = (uint)get_global_id(0);
  const Level small = find_level(textures[number], level), large = find_level(textures[number], level - 1);
  if (i >= large.width * large.height) return;
  const uint x = i % large.width, y = i / large.width;
  float4 sum = 0.0f;
  for (uint row = y * small.height / large.height; row < small.height; ++row) {
    const float part_y = covered_part(row, small.height, y, large.height);
    if (part_y == 0.0f) break;
    for (uint column = x * small.width / large.width; column < small.width; ++column) {
      const float part_x = covered_part(column, small.width, x, large.width);
      if (part_x == 0.0f) break;
      sum += part_x * part_y * grad[small.first + row * small.width + column];
    }
  }
  grad[large.first + i] += sum;
}
