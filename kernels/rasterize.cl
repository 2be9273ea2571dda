// Triangles to fragments. A pair's coverage of its tile is a 64-bit mask; fragments are listed by pair (so
// that a triangle's fragments lie together: uniform triangle data, gathers without atomics), and every pixel
// has the list of its own.
#include "rasterize.h"

#define DPR_ROW_MASK 0xffu

/// A row of a mask: bit k is column k of the tile.
static inline uint mask_row(uint2 mask, uint row) {
  return ((row < 4 ? mask.x : mask.y) >> (8 * (row & 3))) & DPR_ROW_MASK;
}

/// Which pixels of its tile a triangle's blurred area covers: those it owns, and those closer than the blur
/// distance. One work-item for every pair within the capacity; where there is no pair, nothing is covered.
/// in   pairs   uint[1]      how many there are
/// in   triangles  Triangle[view][face]
/// in   pair_face  uint[pair]  view * faces + face
/// in   pair_tile  uint[pair]  view * tiles + tile
/// out  masks   uint2[capacity]  bit 8 * row + column
/// out  counts  uint[capacity]   covered pixels
kernel void rasterize_cover(const FrameParams p, const uint capacity, global const uint* restrict pairs,
                            global const Triangle* restrict triangles, global const uint* restrict pair_face,
                            global const uint* restrict pair_tile, global uint2* restrict masks,
                            global uint* restrict counts) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= capacity) return;
  if (pair >= pairs[0]) {
    masks[pair] = 0;
    counts[pair] = 0;
    return;
  }
  const uint2 mask = cover_tile(p, triangles[pair_face[pair]], pair_tile[pair]);
  masks[pair] = mask;
  counts[pair] = popcount(mask.x) + popcount(mask.y);
}

/// Counts the fragments of every pixel. One work-item per vector of pixels of a tile's row.
/// in   tile_starts  uint[view * tile + 1]  runs of pairs
/// in   masks        as rasterize_cover leaves them
/// out  counts       uint[view][height][width]
kernel void rasterize_count(const FrameParams p, global const uint* restrict tile_starts,
                            global const uint2* restrict masks, global uint* restrict counts) {
  const uint parts = DPR_TILE * DPR_TILE / DPR_WIDTH;
  const uint tiles = p.tiles_x * p.tiles_y;
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * tiles * parts) return;
  const uint tile = i / parts, in_view = tile % tiles, part = i % parts * DPR_WIDTH;
  const uint row = in_view / p.tiles_x * DPR_TILE + part / DPR_TILE;
  const uint column = in_view % p.tiles_x * DPR_TILE + part % DPR_TILE;
  if (row >= p.height) return;

  uintn sum = 0;
  for (uint pair = tile_starts[tile]; pair < tile_starts[tile + 1]; ++pair) {
    const uint bits = mask_row(masks[pair], part / DPR_TILE) >> (part % DPR_TILE);
    sum += ((uintn)(bits) >> convert_uintn(DPR_LANE_INDEX)) & 1u;
  }
  uint lanes[DPR_WIDTH];
  store_n(sum, 0, lanes);
  const uint pixel = (tile / tiles * p.height + row) * p.width + column;
  for (uint lane = 0; lane < DPR_WIDTH && column + lane < p.width; ++lane) counts[pixel + lane] = lanes[lane];
}

/// Where every row of tiles begins: what the host cuts bands by. One work-item per row of tiles of all views,
/// and one more.
/// in   tile_starts      uint[view * tile + 1]  runs of pairs
/// in   pair_starts      uint[view * face + 1]  whose last is the number of pairs, fitting or not
/// in   fragment_starts  uint[pair + 1]   runs of fragments
/// in   contour_starts   uint[last_contour + 1]  whose last is the number of contours' pairs, fitting or not
/// out  rows  uint4[view * tiles_y + 1]   the first pair and fragment; z = the number of pairs, w = that of
///                                        contours' pairs
kernel void rasterize_rows(const FrameParams p, const uint last_contour,
                           global const uint* restrict tile_starts, global const uint* restrict pair_starts,
                           global const uint* restrict fragment_starts,
                           global const uint* restrict contour_starts, global uint4* restrict rows) {
  const uint row = (uint)get_global_id(0);
  if (row > p.views * p.tiles_y) return;
  const uint pair = tile_starts[row * p.tiles_x];
  rows[row] =
      (uint4)(pair, fragment_starts[pair], pair_starts[p.views * p.faces], contour_starts[last_contour]);
}

/// Whether the totals of a frame, pairs, fragments and contours' pairs, exceed the capacity of its buffers.
static inline int exceeds(uint4 last, uint4 capacity) {
  return last.z > capacity.x || last.y > capacity.y || last.w > capacity.z;
}

/// Empties a frame that exceeds the capacity of the buffers, so that no later kernel goes behind a buffer's
/// end, forward or backward. A work-item takes every N-th element, where N is the size of the launch.
/// in   capacity  pairs, fragments, contours' pairs; w unused
/// in   sizes     pixels, faces of all views, edges of all views, the last row
/// in   rows  uint4[last row + 1]  whose last has the totals
/// out  masks, fragment_starts, pixel_starts, pair_starts, contour_starts  all 0, or left as they are
kernel void rasterize_fit(const uint4 capacity, const uint4 sizes, global const uint4* restrict rows,
                          global uint2* restrict masks, global uint* restrict fragment_starts,
                          global uint* restrict pixel_starts, global uint* pair_starts,
                          global uint* contour_starts) {
  if (!exceeds(rows[sizes.w], capacity)) return;
  const uint first = (uint)get_global_id(0), step = (uint)get_global_size(0);
  for (uint i = first; i < capacity.x; i += step) masks[i] = 0;
  for (uint i = first; i <= capacity.x; i += step) fragment_starts[i] = 0;
  for (uint i = first; i <= sizes.x; i += step) pixel_starts[i] = 0;
  for (uint i = first; i <= sizes.y; i += step) pair_starts[i] = 0;
  for (uint i = first; i <= sizes.z; i += step) contour_starts[i] = 0;
}

/// Keeps what a frame was like for a host that asks later. One work-item.
/// in   capacity, rows  as rasterize_fit
/// in   last_row
/// in out  history  uint4[1]  the most pairs, fragments and contours' pairs so far; w = frames emptied
kernel void rasterize_note(const uint4 capacity, const uint last_row, global const uint4* restrict rows,
                           global uint4* restrict history) {
  if (get_global_id(0) != 0) return;
  const uint4 last = rows[last_row], before = history[0];
  history[0] = (uint4)(max(before.xyz, last.zyw), before.w + (exceeds(last, capacity) ? 1u : 0u));
}

/// Counts runs from a band's first element. The runs are `columns` from `first` on and as many from every
/// `stride` after, `rows` times. One work-item per run, and one more in every row.
/// in   starts       uint[...]  of the frame
/// out  band_starts  uint[...]  those of the band, where they were
kernel void rasterize_rebase(const uint first, const uint columns, const uint rows, const uint stride,
                             global const uint* restrict starts, global uint* restrict band_starts) {
  const uint i = (uint)get_global_id(0);
  const uint row = i / (columns + 1), begin = first + row * stride, run = begin + i % (columns + 1);
  if (row >= rows) return;
  uint before = 0;
  for (uint k = first; k < begin; k += stride) before += starts[k + columns] - starts[k];
  band_starts[run] = before + starts[run] - starts[begin];
}

/// Lists the fragments of every pixel of a band, in the order of the faces. One work-item per vector of
/// pixels of a tile's row, up to `last_vector`.
/// in   tile_starts, masks  as rasterize_count
/// in   fragment_starts  uint[pair + 1]   runs of fragments
/// in   pixel_starts     uint[pixel + 1]  runs of the lists
/// out  lists            uint[...]        fragments, by pixel
kernel void rasterize_list(const FrameParams p, const uint last_vector,
                           global const uint* restrict tile_starts, global const uint2* restrict masks,
                           global const uint* restrict fragment_starts,
                           global const uint* restrict pixel_starts, global uint* restrict lists) {
  const uint parts = DPR_TILE * DPR_TILE / DPR_WIDTH;
  const uint tiles = p.tiles_x * p.tiles_y;
  const uint i = (uint)get_global_id(0);
  if (i >= last_vector) return;
  const uint tile = i / parts, in_view = tile % tiles, part = i % parts * DPR_WIDTH;
  const uint row = in_view / p.tiles_x * DPR_TILE + part / DPR_TILE;
  const uint column = in_view % p.tiles_x * DPR_TILE + part % DPR_TILE;
  if (row >= p.height) return;

  const uint pixel = (tile / tiles * p.height + row) * p.width + column;
  uint next[DPR_WIDTH];
  for (uint lane = 0; lane < DPR_WIDTH; ++lane)
    next[lane] = column + lane < p.width ? pixel_starts[pixel + lane] : 0;
  // The pixels of the tile before this vector: their bits say how many of a pair's fragments come first.
  const uint2 before =
      (uint2)(part < 32 ? (1u << part) - 1u : 0xffffffffu, part < 32 ? 0u : (1u << (part - 32)) - 1u);
  for (uint pair = tile_starts[tile]; pair < tile_starts[tile + 1]; ++pair) {
    const uint2 mask = masks[pair];
    uint bits = mask_row(mask, part / DPR_TILE) >> (part % DPR_TILE) & ((1u << DPR_WIDTH) - 1u);
    if (bits == 0) continue;
    uint fragment = fragment_starts[pair] + popcount(mask.x & before.x) + popcount(mask.y & before.y);
    for (; bits != 0; bits &= bits - 1) lists[next[lowest_bit(bits)]++] = fragment++;
  }
}

/// Takes a vector of pixels, x | y << 16, out of a mask, row by row. Behind the mask's last pixel that one is
/// repeated. `corner` is the tile's first pixel.
static inline uintn take_pixels(ulong* mask, uint corner) {
  uint lanes[DPR_WIDTH];
#pragma unroll
  for (uint lane = 0; lane < DPR_WIDTH; ++lane) {
    const uint bit = 63 - (uint)clz(*mask & -*mask);
    lanes[lane] = corner + (bit % DPR_TILE | bit / DPR_TILE << 16);
    const ulong rest = *mask & (*mask - 1);
    *mask = rest != 0 ? rest : *mask;
  }
  return load_n(0, lanes);
}

/// What a fragment is: distance, depth, barycentrics. One work-item per group of `pairs`. Deterministic.
/// in   triangles, pair_face, pair_tile, masks  as rasterize_cover
/// in   fragment_starts  uint[pair + 1]  runs of fragments
/// out  fragment_pair  uint[fragment]
/// out  pixels    uint[fragment]   x | y << 16
/// out  distance  float[fragment]  NDC^2, or NDC if the metric is Euclidean; its sign bit is clear where the
///                                 triangle owns the sample, at distance 0 too. 0 where p.sharp is set
/// out  depth     float[fragment]  view depth by the clipped barycentrics
/// out  bary1, bary2  float[fragment]  clipped barycentrics of vertices 1 and 2: negatives to zero, sum 1
kernel void rasterize_forward(const FrameParams p, const uint2 pairs,
                              global const Triangle* restrict triangles,
                              global const uint* restrict pair_face, global const uint* restrict pair_tile,
                              global const uint2* restrict masks, global const uint* restrict fragment_starts,
                              global uint* restrict fragment_pair, global uint* restrict pixels,
                              global float* restrict distance, global float* restrict depth,
                              global float* restrict bary1, global float* restrict bary2) {
  const uint2 group = pair_group(pairs);
  if (group.x >= group.y) return;
  const uint end = fragment_starts[group.y];
  for (uint pair = group.x; pair < group.y; ++pair) {
    const uint first = fragment_starts[pair], last = fragment_starts[pair + 1];
    if (first == last) continue;
    const Triangle t = triangles[pair_face[pair]];
    const uint tile = pair_tile[pair] % (p.tiles_x * p.tiles_y);
    const uint corner = tile % p.tiles_x * DPR_TILE | tile / p.tiles_x * DPR_TILE << 16;
    const BarycentricScale scale = barycentric_scale(t, p.perspective_correct);
    const float error = side_error(p, t);
    ulong mask = (ulong)masks[pair].y << 32 | masks[pair].x;
    for (uint i = first; i < last; i += DPR_WIDTH) {
      const uintn packed = take_pixels(&mask, corner);
      store_run_uint((uintn)(pair), i, end, fragment_pair);
      store_run_uint(packed, i, end, pixels);
      const realn x = pixel_x(p, convert_realn(packed & 0xffffu)),
                  y = pixel_y(p, convert_realn(packed >> 16));
      const View3 v = view_triangle(t, x, y);
      store_run(
          p.sharp ? (realn)(0.0f) : with_sign(p, triangle_distance2(v), is_inside(p, t, v, error, packed)), i,
          end, distance);

      realn n[3];
      raw_barycentrics(v, scale, n);
      const realn inverse_sum = inverse_of_clipped(n);
      const realn c1 = greater(n[1], 0.0f) * inverse_sum, c2 = greater(n[2], 0.0f) * inverse_sum;
      store_run(c1, i, end, bary1);
      store_run(c2, i, end, bary2);
      // Around z0, so that the difference of the depths keeps its digits.
      store_run(t.z0 + c1 * (t.z1 - t.z0) + c2 * (t.z2 - t.z0), i, end, depth);
    }
  }
}

/// Gradients of the triangle's corners, summed over a pair's fragments. One work-item per pair, up to
/// `last_pair`.
/// in   triangles, pair_face, fragment_starts, pixels  as rasterize_forward
/// in   distance       float[fragment]  whose sign says on which side the sample lies
/// in   grad_distance, grad_depth, grad_bary1, grad_bary2  float[fragment]
/// out  grad_corners   float[pair][9]   x, y (NDC) and view depth of vertices 0, 1, 2
kernel void rasterize_backward(const FrameParams p, const uint last_pair,
                               global const Triangle* restrict triangles,
                               global const uint* restrict pair_face,
                               global const uint* restrict fragment_starts,
                               global const uint* restrict pixels, global const float* restrict distance,
                               global const float* restrict grad_distance,
                               global const float* restrict grad_depth,
                               global const float* restrict grad_bary1,
                               global const float* restrict grad_bary2, global float* restrict grad_corners) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= last_pair) return;
  const uint first = fragment_starts[pair], last = fragment_starts[pair + 1];
  if (first == last) {
    for (int k = 0; k < 9; ++k) grad_corners[9 * pair + k] = 0.0f;
    return;
  }
  CornerGradients g;
#pragma unroll
  for (int k = 0; k < 3; ++k) g.x[k] = g.y[k] = g.z[k] = 0.0f;
  const Triangle t = triangles[pair_face[pair]];
  const BarycentricScale scale = barycentric_scale(t, p.perspective_correct);
  for (uint i = first; i < last; i += DPR_WIDTH) {
    const intn in_run = lanes_before(last, i);
    const uintn packed = load_pixels(in_run, i, pixels);
    const realn x = pixel_x(p, convert_realn(packed & 0xffffu)), y = pixel_y(p, convert_realn(packed >> 16));
    const View3 v = view_triangle(t, x, y);
    if (!p.sharp) {
      add_distance_gradient(v, DPR_NO_EDGE, as_intn(load_run(in_run, i, distance)) >= 0, p.euclidean,
                            load_run(in_run, i, grad_distance), &g);
    }
    add_barycentric_gradient(v, t, scale, load_run(in_run, i, grad_depth), load_run(in_run, i, grad_bary1),
                             load_run(in_run, i, grad_bary2), &g);
  }
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    grad_corners[9 * pair + 3 * k] = sum_lanes(g.x[k]);
    grad_corners[9 * pair + 3 * k + 1] = sum_lanes(g.y[k]);
    grad_corners[9 * pair + 3 * k + 2] = sum_lanes(g.z[k]);
  }
}
