// Triangles to fragments. A pair's coverage of its tile is a 64-bit mask; fragments are listed by pair (so
// that a triangle's fragments lie together: uniform triangle data, gathers without atomics), and every pixel
// has the list of its own.
#include "face_rows.h"
#include "rasterize.h"
#include "window.h"

/// Pixels of a tile that a work-item of the listing kernels has to itself: on a CPU all of them, so that it
/// reads the pairs of the tile once.
#if DPR_WIDTH == 1
#define DPR_TILE_SHARE 1
#else
#define DPR_TILE_SHARE (DPR_TILE * DPR_TILE)
#endif

/// State of a work-item of the listing kernels.
typedef struct {
  uint tile;               // of all views
  uint first;              // of its pixels, as the masks count them: 8 * row + column
  uint view, column, row;  // where the tile begins
} TileShare;

static inline TileShare tile_share(const FrameParams p, uint i) {
  const uint tiles = p.tiles_x * p.tiles_y, shares = DPR_TILE * DPR_TILE / DPR_TILE_SHARE;
  TileShare s;
  s.tile = i / shares;
  s.first = i % shares * DPR_TILE_SHARE;
  s.view = s.tile / tiles;
  s.row = s.tile % tiles / p.tiles_x * DPR_TILE;
  s.column = s.tile % p.tiles_x * DPR_TILE;
  return s;
}

/// The pixel of a share that the masks call `bit`, if it is in the image.
static inline int is_in_image(const FrameParams p, const TileShare s, uint bit) {
  return s.row + bit / DPR_TILE < p.height && s.column + bit % DPR_TILE < p.width;
}
static inline uint pixel_of(const FrameParams p, const TileShare s, uint bit) {
  return place_of_sample(p, s.view, s.column + bit % DPR_TILE, s.row + bit / DPR_TILE);
}

static inline uint lowest_bit_of(ulong mask) { return 63 - (uint)clz(mask & -mask); }

/// Which pixels of its tile a triangle's blurred area covers: those it owns, and those closer than the blur
/// distance. Any number of work-items.
/// in   pairs   uint[1]      how many there are
/// in   triangles  Triangle[view][face]
/// in   pair_face  uint[pair]  view * faces + face
/// in   pair_tile  uint[pair]  view * tiles + tile
/// out  masks   uint2[pair]  bit 8 * row + column
/// out  counts  uint[pair]   covered pixels
kernel void rasterize_cover(const FrameParams p, global const uint* restrict pairs,
                            global const Triangle* restrict triangles, global const uint* restrict pair_face,
                            global const uint* restrict pair_tile, global uint2* restrict masks,
                            global uint* restrict counts) {
  for (uint pair = (uint)get_global_id(0); pair < pairs[0]; pair += (uint)get_global_size(0)) {
    const uint2 mask = cover_tile(p, triangles[pair_face[pair]], pair_tile[pair]);
    masks[pair] = mask;
    counts[pair] = popcount(mask.x) + popcount(mask.y);
  }
}

/// Counts the fragments of every pixel of the window. One work-item per share of a tile, up to p.last_tile.
/// in   tile_starts  uint[view * tile + 1]  runs of pairs
/// in   masks        as rasterize_cover leaves them
/// out  counts       uint[pixel of the window]
kernel void rasterize_count(const FrameParams p, global const uint* restrict tile_starts,
                            global const uint2* restrict masks, global uint* restrict counts) {
  const TileShare s = tile_share(p, (uint)get_global_id(0));
  if (s.tile >= p.last_tile) return;
  uintn sums[DPR_TILE_SHARE / DPR_WIDTH];
  for (uint v = 0; v < DPR_TILE_SHARE / DPR_WIDTH; ++v) sums[v] = 0;
  for (uint pair = tile_starts[s.tile]; pair < tile_starts[s.tile + 1]; ++pair) {
    const ulong mask = whole_mask(masks[pair]) >> s.first;
#pragma unroll
    for (uint v = 0; v < DPR_TILE_SHARE / DPR_WIDTH; ++v)
      sums[v] += ((uintn)((uint)(mask >> (v * DPR_WIDTH))) >> convert_uintn(DPR_LANE_INDEX)) & 1u;
  }
  for (uint v = 0; v < DPR_TILE_SHARE / DPR_WIDTH; ++v) {
    const uint bit = s.first + v * DPR_WIDTH;
    if (!is_in_image(p, s, bit)) continue;
    if (is_in_image(p, s, bit + DPR_WIDTH - 1)) {
      store_n(sums[v], pixel_of(p, s, bit), counts);
      continue;
    }
    uint lanes[DPR_WIDTH];
    store_n(sums[v], 0, lanes);
    for (uint lane = 0; is_in_image(p, s, bit + lane); ++lane)
      counts[pixel_of(p, s, bit + lane)] = lanes[lane];
  }
}

/// Finds the first pair of every row of tiles: the host cuts bands there. One work-item per row of all views,
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

/// True if the totals of a frame, pairs, fragments and contours' pairs, exceed the capacity of its buffers.
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
/// in out  history  uint4[2]  the most pairs, fragments and contours' pairs so far, and those of this frame;
///                            w = frames emptied so far
kernel void rasterize_note(const uint4 capacity, const uint last_row, global const uint4* restrict rows,
                           global uint4* restrict history) {
  if (get_global_id(0) != 0) return;
  const uint4 last = rows[last_row], before = history[0];
  const uint emptied = before.w + (exceeds(last, capacity) ? 1u : 0u);
  history[0] = (uint4)(max(before.xyz, last.zyw), emptied);
  history[1] = (uint4)(last.zyw, emptied);
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

/// Lists the fragments of every pixel of a band, in the order of the faces. One work-item per share of a
/// tile, up to `last_share`.
/// in   tile_starts, masks  as rasterize_count
/// in   fragment_starts  uint[pair + 1]   runs of fragments
/// in   pixel_starts     uint[pixel + 1]  runs of the lists
/// out  lists            uint[...]        fragments, by pixel
kernel void rasterize_list(const FrameParams p, const uint last_share,
                           global const uint* restrict tile_starts, global const uint2* restrict masks,
                           global const uint* restrict fragment_starts,
                           global const uint* restrict pixel_starts, global uint* restrict lists) {
  const uint i = (uint)get_global_id(0);
  if (i >= last_share) return;
  const TileShare s = tile_share(p, i);
  const uint first = tile_starts[s.tile], last = tile_starts[s.tile + 1];
  if (first == last) return;
  uint next[DPR_TILE_SHARE];
  for (uint k = 0; k < DPR_TILE_SHARE; ++k)
    next[k] = is_in_image(p, s, s.first + k) ? pixel_starts[pixel_of(p, s, s.first + k)] : 0;
  // The share's pixels, and those before: their bits say how many of a pair's fragments come first.
  const ulong own = (~0ul >> (DPR_TILE * DPR_TILE - DPR_TILE_SHARE)) << s.first,
              before = (1ul << s.first) - 1;
  for (uint pair = first; pair < last; ++pair) {
    const ulong mask = whole_mask(masks[pair]);
    uint fragment = fragment_starts[pair] + (uint)popcount(mask & before);
    for (ulong bits = mask & own; bits != 0; bits &= bits - 1)
      lists[next[lowest_bit_of(bits) - s.first]++] = fragment++;
  }
}

/// Takes a vector of pixels, x | y << 16, out of a mask, row by row. Behind the mask's last pixel the tile's
/// last one is repeated. `corner` is the tile's first pixel.
static inline uintn take_pixels(ulong* mask, uint corner) {
  uint bits[DPR_WIDTH];
#pragma unroll
  for (uint lane = 0; lane < DPR_WIDTH; ++lane) {
    bits[lane] = lowest_bit_of(*mask);  // -1 if there is none
    *mask &= *mask - 1;
  }
  const uintn bit = load_n(0, bits) % (DPR_TILE * DPR_TILE);
  return corner + (bit % DPR_TILE | bit / DPR_TILE << 16);
}

/// What a fragment is: distance, depth, barycentrics. One work-item per group of pairs in
/// `range`. Deterministic.
/// in   triangles, pair_face, pair_tile, masks  as rasterize_cover
/// in   fragment_starts  uint[pair + 1]  runs of fragments
/// out  fragment_pair  uint[fragment]
/// out  pixels    uint[fragment]   x | y << 16
/// out  fragments  float[plane][fragment]  DISTANCE, NDC^2, or NDC if the metric is Euclidean; its sign bit is
///                                 clear where the triangle owns the sample, at distance 0 too. 0 where
///                                 p.sharp is set. BARY: negatives to zero, sum 1. DEPTH
kernel void rasterize_forward(const FrameParams p, const uint2 range, global const uint* restrict pairs,
                              global const Triangle* restrict triangles,
                              global const uint* restrict pair_face, global const uint* restrict pair_tile,
                              global const uint2* restrict masks, global const uint* restrict fragment_starts,
                              global uint* restrict fragment_pair, global uint* restrict pixels,
                              global float* restrict fragments) {
  const uint2 group = pair_group(range, pairs[0]);
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
    ulong mask = whole_mask(masks[pair]);
    for (uint i = first; i < last; i += DPR_WIDTH) {
      const uintn packed = take_pixels(&mask, corner);
      store_run_uint((uintn)(pair), i, end, fragment_pair);
      store_run_uint(packed, i, end, pixels);
      const realn x = pixel_x(p, convert_realn(packed & 0xffffu)),
                  y = pixel_y(p, convert_realn(packed >> 16));
      const View3 v = view_triangle(t, x, y);
      store_run(
          p.sharp ? (realn)(0.0f) : with_sign(p, triangle_distance2(v), is_inside(p, t, v, error, packed)), i,
          end, fragments + DPR_PLANE(p, DISTANCE));

      realn n[3];
      raw_barycentrics(v, scale, n);
      const realn inverse_sum = inverse_of_clipped(n);
      const realn c1 = greater(n[1], 0.0f) * inverse_sum, c2 = greater(n[2], 0.0f) * inverse_sum;
      global float* const bary = fragments + DPR_PLANE(p, BARY);
      store_run(c1, i, end, bary);
      store_run(c2, i, end, bary + p.fragments);
      // Around z0, so that the difference of the depths keeps its digits.
      store_run(t.z0 + c1 * (t.z1 - t.z0) + c2 * (t.z2 - t.z0), i, end, fragments + DPR_PLANE(p, DEPTH));
    }
  }
}

/// Gradients of the triangle's corners, summed over a pair's fragments, of pairs up to `last_pair`. Any number
/// of work-items.
/// in   triangles, pair_face, fragment_starts, pixels  as rasterize_forward
/// in   fragments      float[plane][fragment]  DISTANCE, whose sign says on which side the sample lies
/// in   grads          float[plane][fragment]  of DISTANCE, DEPTH, BARY
/// out  grad_corners   float[pair][9]   x, y (NDC) and view depth of vertices 0, 1, 2
kernel void rasterize_backward(const FrameParams p, const uint last_pair, global const uint* restrict pairs,
                               global const Triangle* restrict triangles,
                               global const uint* restrict pair_face,
                               global const uint* restrict fragment_starts,
                               global const uint* restrict pixels, global const float* restrict fragments,
                               global const float* restrict grads, global float* restrict grad_corners) {
  const uint end = min(last_pair, pairs[0]);
  for (uint pair = (uint)get_global_id(0); pair < end; pair += (uint)get_global_size(0)) {
    const uint first = fragment_starts[pair], last = fragment_starts[pair + 1];
    if (first == last) {
      for (int k = 0; k < 9; ++k) grad_corners[9 * pair + k] = 0.0f;
      continue;
    }
    CornerGradients g = no_corner_gradients();
    const Triangle t = triangles[pair_face[pair]];
    const BarycentricScale scale = barycentric_scale(t, p.perspective_correct);
    for (uint i = first; i < last; i += DPR_WIDTH) {
      const intn in_run = lanes_before(last, i);
      const uintn packed = load_pixels(in_run, i, pixels);
      const realn x = pixel_x(p, convert_realn(packed & 0xffffu)),
                  y = pixel_y(p, convert_realn(packed >> 16));
      const View3 v = view_triangle(t, x, y);
      if (!p.sharp) {
        const intn inside = as_intn(load_run(in_run, i, fragments + DPR_PLANE(p, DISTANCE))) >= 0;
        add_distance_gradient(v, DPR_NO_EDGE, inside, p.euclidean,
                              load_run(in_run, i, grads + DPR_GRAD_PLANE(p, DISTANCE)), &g);
      }
      global const float* const grad_bary = grads + DPR_GRAD_PLANE(p, BARY);
      add_barycentric_gradient(v, t, scale, load_run(in_run, i, grads + DPR_GRAD_PLANE(p, DEPTH)),
                               load_run(in_run, i, grad_bary),
                               load_run(in_run, i, grad_bary + p.grad_fragments), &g);
    }
#pragma unroll
    for (int k = 0; k < 3; ++k) {
      grad_corners[9 * pair + 3 * k] = sum_lanes(g.x[k]);
      grad_corners[9 * pair + 3 * k + 1] = sum_lanes(g.y[k]);
      grad_corners[9 * pair + 3 * k + 2] = sum_lanes(g.z[k]);
    }
  }
}

/// Tangents of what a fragment is, by those of its triangle's corners. One work-item per group of pairs in
/// `range`. Deterministic.
/// in   triangles, pair_face, fragment_starts, pixels  as rasterize_forward
/// in   faces     uint4[face]  vertex indices
/// in   vertices  float4[direction][view][vertex]  of x, y (NDC) and view depth
/// in   fragments  float[plane][fragment]  DISTANCE, whose sign says on which side the sample lies, and BARY
/// out  tangents  float[direction][q.planes][fragment]  of DEPTH, BARY; of DISTANCE in place of LOG_OCCUPANCY
kernel void rasterize_tangent(const FrameParams p, const uint2 range, const TangentParams q,
                              global const uint* restrict pairs, global const Triangle* restrict triangles,
                              global const uint* restrict pair_face,
                              global const uint* restrict fragment_starts, global const uint* restrict pixels,
                              global const uint4* restrict faces, global const float4* restrict vertices,
                              global const float* restrict fragments, global float* restrict tangents) {
  const uint2 group = pair_group(range, pairs[0]);
  if (group.x >= group.y) return;
  const uint end = fragment_starts[group.y];
  for (uint pair = group.x; pair < group.y; ++pair) {
    const uint first = fragment_starts[pair], last = fragment_starts[pair + 1];
    if (first == last) continue;
    const uint view_face = pair_face[pair], view = view_face / p.faces;
    const uint4 face = faces[first_row(p, view) + view_face - view * p.faces];
    const Triangle t = triangles[view_face];
    const BarycentricScale scale = barycentric_scale(t, p.perspective_correct);
    for (uint i = first; i < last; i += DPR_WIDTH) {
      const intn in_run = lanes_before(last, i);
      const uintn packed = load_pixels(in_run, i, pixels);
      const View3 v = view_triangle(t, pixel_x(p, convert_realn(packed & 0xffffu)),
                                    pixel_y(p, convert_realn(packed >> 16)));
      CornerGradients by_distance = no_corner_gradients(), by_c1 = by_distance, by_c2 = by_distance;
      if (!p.sharp) {
        const intn inside = as_intn(load_run(in_run, i, fragments + DPR_PLANE(p, DISTANCE))) >= 0;
        add_distance_gradient(v, DPR_NO_EDGE, inside, p.euclidean, (realn)(1.0f), &by_distance);
      }
      add_barycentric_gradient(v, t, scale, (realn)(0.0f), (realn)(1.0f), (realn)(0.0f), &by_c1);
      add_barycentric_gradient(v, t, scale, (realn)(0.0f), (realn)(0.0f), (realn)(1.0f), &by_c2);
      const realn c1 = load_run(in_run, i, fragments + DPR_PLANE(p, BARY));
      const realn c2 = load_run(in_run, i, fragments + DPR_PLANE(p, BARY) + p.fragments);
      for (uint d = 0; d < q.directions; ++d) {
        global const float4* const of_view = vertices + (size_t)(d * p.views + view) * p.vertices;
        const CornerTangents move = {{of_view[face.x].xyz, of_view[face.y].xyz, of_view[face.z].xyz}};
        const realn b1 = along_corners(by_c1, move), b2 = along_corners(by_c2, move);
        global float* const out = tangents + (size_t)d * q.planes * p.grad_fragments;
        store_run(b1, i, end, out + DPR_GRAD_PLANE(p, BARY));
        store_run(b2, i, end, out + DPR_GRAD_PLANE(p, BARY) + p.grad_fragments);
        store_run((1.0f - c1 - c2) * move.corner[0].z + c1 * move.corner[1].z + c2 * move.corner[2].z +
                      b1 * (t.z1 - t.z0) + b2 * (t.z2 - t.z0),
                  i, end, out + DPR_GRAD_PLANE(p, DEPTH));
        store_run(p.sharp ? (realn)(0.0f) : along_corners(by_distance, move), i, end,
                  out + DPR_GRAD_PLANE(p, LOG_OCCUPANCY));
      }
    }
  }
}
