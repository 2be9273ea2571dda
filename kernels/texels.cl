// The smaller levels of textures; and gradients of texels: each cell adds its fragments in their order, each
// texel its four cells. No atomics, so the sums are the same from run to run, and however a frame is cut into
// bands.
#include "pyramid.h"

/// Adds a band's fragments to the sums of their cells. One work-item per cell of `cells`. Deterministic.
/// in   cells      how many there are, one for every texel
/// in   starts     uint[cell + 1]    runs of `numbers`
/// in   numbers    uint[...]         fragments, by cell
/// in   parts, grad_seen  as surface_list leaves them
/// in out  sums    float4[4][cell]   for the cell's own texel, the one to the right, the one below, the one
///      below that
kernel void texels_sum(const uint cells, global const uint* restrict starts,
                       global const uint* restrict numbers, global const float2* restrict parts,
                       global const float4* restrict grad_seen, global float4* restrict sums) {
  const uint cell = (uint)get_global_id(0);
  if (cell >= cells || starts[cell] == starts[cell + 1]) return;
  float4 sum[4];
  for (uint k = 0; k < 4; ++k) sum[k] = sums[k * cells + cell];
  for (uint place = starts[cell]; place < starts[cell + 1]; ++place) {
    const uint i = numbers[place];
    const float4 lower = parts[i].y * grad_seen[i], upper = grad_seen[i] - lower;
    const float right = parts[i].x, left = 1.0f - right;
    sum[0] += left * upper;
    sum[1] += right * upper;
    sum[2] += left * lower;
    sum[3] += right * lower;
  }
  for (uint k = 0; k < 4; ++k) sums[k * cells + cell] = sum[k];
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

/// Texels of one level from their cells. One work-item per texel of it. Deterministic.
/// in   cells     how many there are, one for every texel of all textures
/// in   number    the texture's
/// in   level     of its pyramid
/// in   textures  Texture[texture]
/// in   sums      as texels_sum leaves them
/// out  grad      float4[texel]  of all textures
kernel void texels_gather(const uint cells, const uint number, const uint level,
                          global const Texture* restrict textures, global const float4* restrict sums,
                          global float4* restrict grad) {
  const uint i = (uint)get_global_id(0);
  const Level l = find_level(textures[number], level);
  if (i >= l.width * l.height) return;
  const uint x = i % l.width, y = i / l.width;
  const uint left = x == 0 ? l.width - 1 : x - 1, above = y == 0 ? l.height - 1 : y - 1;
  global const float4* own = sums + l.first;
  grad[l.first + i] = own[y * l.width + x] + own[cells + y * l.width + left] +
                      own[2 * cells + above * l.width + x] + own[3 * cells + above * l.width + left];
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
