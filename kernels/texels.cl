// The smaller levels of textures; and gradients of texels, gathered from the four cells that have them. A
// texel's fragments are added up by tile, in order, and tiles in order (texel_runs.h). No atomics on sums.
//
// On a GPU no work-item walks a list as long as an image: texels_runs adds up the fragments of each tile in each
// cell, texels_sum the few tiles of a texel, and texels_sum_shared, a group a texel, those of texels with many.
#include "group.h"
#include "texel_runs.h"

#if DPR_LANES == 1

/// Sorted places that a group holds: its block's, the one before, and as many behind as tell a long run.
#define DPR_HELD_PLACES (1 + DPR_TEXEL_BLOCK + DPR_TEXEL_RUN)
#define DPR_NO_CELL 0xffffffffu

/// The parts of a block of fragments that are summed, and cells and tiles of those and of the ones around.
typedef struct {
  local float *red, *green, *blue, *right, *below;
  local uint *cell, *tile;
} HeldPlaces;

static inline void hold_places(const HeldPlaces held, uint first, uint count, const SeenList seen,
                               global const uint* cells) {
  for (uint i = (uint)get_local_id(0); i < DPR_HELD_PLACES; i += DPR_GROUP) {
    const uint place = first + i - 1;  // before the first place: beyond every count
    held.cell[i] = place < count ? cells[place] : DPR_NO_CELL;
    if (place >= count) continue;
    const SeenTexels at = seen.at[seen.numbers[place]];
    held.tile[i] = at.tile;
    const uint k = i - 1;
    if (k >= DPR_TEXEL_BLOCK) continue;
    held.red[k] = at.red;
    held.green[k] = at.green;
    held.blue[k] = at.blue;
    held.right[k] = at.right;
    held.below[k] = at.below;
  }
}

static inline int is_in_run(const HeldPlaces held, uint i, uint cell, uint tile) {
  return held.cell[i] == cell && held.tile[i] == tile;
}

/// Adds the places of a run from place `k` of the block on. Returns where it ends, at the end of the block if it may
/// go on behind.
static inline uint add_run(const HeldPlaces held, uint k, uint cell, uint tile, float3 sums[4]) {
  for (; k < DPR_TEXEL_BLOCK && is_in_run(held, k + 1, cell, tile); ++k) {
    const float3 grad = (float3)(held.red[k], held.green[k], held.blue[k]);
#pragma unroll
    for (uint c = 0; c < 4; ++c) sums[c] += texel_share(c, grad, held.right[k], held.below[k]);
  }
  return k;
}

static inline void store_run(uint head, uint end, const float3 sums[4], global float4* run_sums) {
#pragma unroll
  for (uint c = 0; c < 4; ++c) run_sums[4 * (head / DPR_TEXEL_RUN) + c] = (float4)(sums[c], as_float(end));
}

/// The tiles of sorted places; and the sums over a tile's fragments in a cell, where they are more than
/// DPR_TEXEL_RUN: a table in which a run's place is that of its first fragment over DPR_TEXEL_RUN, so that no two
/// share one. One work-group per block of the capacity; a work-item adds a run, in order. Deterministic.
/// in   textured  of the cells: those from 0 on; the others are of no texture
/// in   count    uint[1]           how many places there are
/// in   cells    uint[count]       ascending
/// in   numbers, places            as texels_sum
/// out  tiles    uint[count]
/// out  sums     float4[...][4]    RGB of the four texels of the cell; w = bits of the place behind the run
DPR_GROUP_KERNEL kernel void texels_runs(const uint textured, global const uint* restrict count,
                                         global const uint* restrict cells,
                                         global const uint* restrict numbers,
                                         global const SeenTexels* restrict places,
                                         global uint* restrict tiles, global float4* restrict sums) {
  local float red[DPR_TEXEL_BLOCK], green[DPR_TEXEL_BLOCK], blue[DPR_TEXEL_BLOCK], right[DPR_TEXEL_BLOCK],
      below[DPR_TEXEL_BLOCK];
  local uint held_cells[DPR_HELD_PLACES], held_tiles[DPR_HELD_PLACES], goes_on[1];
  const HeldPlaces held = {red, green, blue, right, below, held_cells, held_tiles};
  const SeenList seen = {numbers, places, 0, 0};
  const uint item = (uint)get_local_id(0), first = (uint)get_group_id(0) * DPR_TEXEL_BLOCK;
  const uint last = min(count[0], first + DPR_TEXEL_BLOCK);
  if (item == 0) goes_on[0] = 0;
  hold_places(held, first, count[0], seen, cells);
  barrier(CLK_LOCAL_MEM_FENCE);
  float3 run[4] = {0.0f, 0.0f, 0.0f, 0.0f};
  uint head = DPR_NO_TILE, cell = DPR_NO_CELL, tile = DPR_NO_TILE;  // of a run that goes on behind the block
  for (uint i = first + item; i < last; i += DPR_GROUP) {
    const uint k = i - first, own_cell = held.cell[k + 1], own_tile = held.tile[k + 1];
    tiles[i] = own_tile;
    if (own_cell >= textured || is_in_run(held, k, own_cell, own_tile)) continue;
    if (!is_in_run(held, k + 1 + DPR_TEXEL_RUN, own_cell, own_tile)) continue;
    for (uint c = 0; c < 4; ++c) run[c] = 0.0f;
    const uint end = add_run(held, k, own_cell, own_tile, run);
    if (end == DPR_TEXEL_BLOCK && is_in_run(held, end + 1, own_cell, own_tile)) {
      head = i;
      cell = own_cell;
      tile = own_tile;
      goes_on[0] = 1;
    } else {
      store_run(i, first + end, run, sums);
    }
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  // The block's last run at most: the group follows it, and one work-item adds.
  for (uint block = first + DPR_TEXEL_BLOCK; goes_on[0]; block += DPR_TEXEL_BLOCK) {
    barrier(CLK_LOCAL_MEM_FENCE);
    hold_places(held, block, count[0], seen, cells);
    barrier(CLK_LOCAL_MEM_FENCE);
    if (head != DPR_NO_TILE) {
      const uint end = add_run(held, 0, cell, tile, run);
      if (end < DPR_TEXEL_BLOCK || !is_in_run(held, end + 1, cell, tile)) {
        store_run(head, block + end, run, sums);
        goes_on[0] = 0;
      }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
  }
}

/// The texels of many fragments, as texels_sum has listed them. One work-group per texel of the list's capacity, a
/// work-item a tile. Deterministic. Arguments as texels_sum has them.
DPR_GROUP_KERNEL kernel void texels_sum_shared(
    global const Texture* restrict textures, global const uint* restrict starts,
    global const uint* restrict numbers, global const SeenTexels* restrict places,
    global const uint* restrict tiles, global const float4* restrict sums, global const uint* restrict shared,
    global float4* restrict grad) {
  local float tile_sums[3 * DPR_GROUP];
  local uint behind[4];
  const uint item = (uint)get_local_id(0), group = (uint)get_group_id(0);
  const int is_there = group < shared[0];
  const SeenList seen = {numbers, places, tiles, sums};
  TexelRuns left = {{0}, {0}};
  global float* out = (global float*)grad;
  if (is_there) {
    uint i = shared[2 + 2 * group];
    const Level l = level_of(textures[shared[1 + 2 * group]], &i);
    left = texel_runs(l, i, starts);
    out = (global float*)(grad + l.first + i);
  }
  float sum = is_there && item < 3 ? out[item] : 0.0f;
  for (uint tile = first_tile(seen, left); tile != DPR_NO_TILE; tile = first_tile(seen, left)) {
    TexelRuns own = left;
    skip_to(seen, tile + item, &own);
    vstore3(take_tile(seen, tile + item, &own), item, tile_sums);
    if (item == DPR_GROUP - 1)
      for (uint k = 0; k < 4; ++k) behind[k] = own.first[k];
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item < 3)
      for (uint j = 0; j < DPR_GROUP; ++j) sum += tile_sums[3 * j + item];
    for (uint k = 0; k < 4; ++k) left.first[k] = behind[k];
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  if (is_there && item < 3) out[item] = sum;
}

#endif

/// Adds a band's fragments to the gradients of a texture's texels. One work-item per texel of all levels, the last
/// first: the fewer texels a level has, the more they have to add. On GPUs texels of many fragments are listed
/// instead. Deterministic.
/// in   number    the texture's
/// in   texels    of all its levels
/// in   textures  Texture[texture]
/// in   starts    uint[cell + 1]    runs of `numbers`; a cell for every texel of all textures
/// in   numbers   uint[...]         places of fragments, by cell
/// in   places    SeenTexels[...]   as surface_list and surface_place leave them
/// in   tiles, sums  on GPUs: as texels_runs leaves them
/// in out  shared  uint[1 + 2 * ...]  on GPUs: how many are listed; and the numbers of each one's texture, and of the
///                 texel in it. In any order: texels are independent
/// in out  grad   float4[texel]     of all textures; w stays
kernel void texels_sum(const uint number, const uint texels, global const Texture* restrict textures,
                       global const uint* restrict starts, global const uint* restrict numbers,
                       global const SeenTexels* restrict places, global const uint* restrict tiles,
                       global const float4* restrict sums, global uint* restrict shared,
                       global float4* restrict grad) {
  if (get_global_id(0) >= texels) return;
  const uint texel = texels - 1 - (uint)get_global_id(0);
  uint i = texel;
  const Level l = level_of(textures[number], &i);
  const SeenList seen = {numbers, places, tiles, sums};
  TexelRuns r = texel_runs(l, i, starts);
  if (is_shared(r)) {
    const uint place = atomic_inc(shared);
    shared[1 + 2 * place] = number;
    shared[2 + 2 * place] = texel;
    return;
  }
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
