// Blur of the rigid image by the noise of the pixel's position, I(x) = E[R(x + s Z)]: passes along columns
// and rows, all of one form (BlurPass). The transpose is a pass too, so backward needs no kernels of its own.
// The order of additions is fixed.
#include "blur.h"

/// The samples of each row of tiles that may differ from one another: those of the tiles that have pairs, and
/// of one more on each side, since contours blend samples with their neighbours. All others show the
/// background.
///
/// NDRange: one work-item per row of tiles of all views.
/// in   tile_starts  uint[view * tile + 1]  runs of pairs
/// out  extents      uint2[view][row of tiles]  the first column, and the one after the last
kernel void blur_extents(const FrameParams p, global const uint* restrict tile_starts,
                         global uint2* restrict extents) {
  const uint row = (uint)get_global_id(0);
  if (row >= p.views * p.tiles_y) return;
  global const uint* starts = tile_starts + row * p.tiles_x;
  uint first = p.tiles_x, last = 0;
  for (uint x = 0; x < p.tiles_x; ++x) {
    const int is_covered = starts[x] != starts[x + 1];
    first = is_covered && x < first ? x : first;
    last = is_covered ? x : last;
  }
  const uint begin = first > 0 ? (first - 1) * DPR_TILE : 0;
  const int is_empty = first == p.tiles_x;
  // Number by number: LLVM 18, in PoCL 6, aborts at a vector that is selected.
  extents[row].x = is_empty ? 0 : begin;
  extents[row].y = is_empty ? 0 : (last + 2) * DPR_TILE;
}

/// Along columns. Where several launches add the rows of inputs, in order, outputs hold the sums so far. NDRange:
/// one work-item per (image, block of output rows, DPR_BLUR_WIDTH pixels), up to p.items.
/// in   extents  as blur_extents leaves them, where p.tile_rows says so: blocks outside are not summed up
/// in   weights  float[tap], between zeros (BlurTaps)
/// in   in       float4[image][in_length][width]
/// in out  out   float4[image][out_length][width]
kernel void blur_columns(const BlurPass p, global const uint2* restrict extents,
                         global const float* restrict weights, global const float4* restrict in,
                         global float4* restrict out) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.items) return;
  const BlurPlace place = column_place(p, i);
  const BlurTaps t = block_taps(p, place.at, DPR_BLUR_BLOCK);
  const int is_before = t.to <= p.first_row && p.first_row > 0,
            is_after = t.from >= p.last_row && p.last_row < (int)p.in_length;
  if (is_before || is_after) return;
  const int is_alike = is_outside_columns(p, place, extents);
  if (is_alike && t.from < p.first_row) return;
  for (int x = 0; x < place.count; x += DPR_BLUR_PIXELS) {
    pixels_n sums[DPR_BLUR_BLOCK];
    fill_sums((pixels_n)(0.0f), sums);
    if (is_alike) {
      fill_sums(load_pixels(in + (place.in + (size_t)x) + (size_t)t.from * p.width), sums);
    } else {
      if (t.from < p.first_row) load_sums(p, place, x, out, sums);
      add_columns(p, place, x, t, weights, in, sums);
    }
#pragma unroll
    for (int row = 0; row < DPR_BLUR_BLOCK; ++row) {
      if (row >= place.steps) break;
      global float4* to = out + (place.out + (size_t)x) + (size_t)row * p.width;
      if (x + DPR_BLUR_PIXELS <= place.count) {
        store_pixels(sums[row], to);
      } else {
        float4 lanes[DPR_BLUR_PIXELS];
        store_lanes(sums[row], lanes);
        for (int lane = 0; x + lane < place.count; ++lane) to[lane] = lanes[lane];
      }
    }
  }
}

/// Along rows, where neighbouring outputs read neighbouring inputs. NDRange: one work-item per (row,
/// DPR_BLUR_ROW_LENGTH output pixels).
/// in   extents  as blur_columns
/// in   weights  float[tap], between zeros (BlurTaps)
/// in   in       float4[row][in_length]
/// out  out      float4[row][out_length]
kernel void blur_rows(const BlurPass p, global const uint2* restrict extents,
                      global const float* restrict weights, global const float4* restrict in,
                      global float4* restrict out) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.lines * row_items_per_line(p)) return;
  const BlurPlace place = row_place(p, i);
  if (is_outside_rows(p, i / row_items_per_line(p), 1, place.at, place.steps, extents)) {
    const float4 value = in[place.in + (size_t)block_taps(p, place.at, place.steps).from];
    for (int k = 0; k < place.steps; ++k) out[place.out + (size_t)k] = value;
    return;
  }
  for (int first = 0; first < place.steps; first += DPR_BLUR_ROW) {
    const int at = place.at + first, steps = place.steps - first;
    global float4* to = out + (place.out + (size_t)first);
    pixels_n sums[DPR_BLUR_ROW_BLOCK];
    row_sums(p, at, steps, weights, in + place.in, sums);
    if (steps >= DPR_BLUR_ROW) {
#pragma unroll
      for (int k = 0; k < DPR_BLUR_ROW_BLOCK; ++k) store_pixels(sums[k], to + k * DPR_BLUR_PIXELS);
      continue;
    }
#pragma unroll
    for (int k = 0; k < DPR_BLUR_ROW; ++k) {
      if (k >= steps) break;
      to[k] = ((const float4*)sums)[k];
    }
  }
}

/// Along rows, where outputs or inputs are further apart. NDRange: one work-item per (DPR_BLUR_PIXELS rows,
/// block of outputs); a lane is a row. Otherwise as blur_rows.
kernel void blur_rows_strided(const BlurPass p, global const uint2* restrict extents,
                              global const float* restrict weights, global const float4* restrict in,
                              global float4* restrict out) {
  const uint i = (uint)get_global_id(0), blocks = groups_of(p.out_length, DPR_BLUR_BLOCK);
  if (i >= groups_of(p.lines, DPR_BLUR_PIXELS) * blocks) return;
  const uint first = i / blocks * DPR_BLUR_PIXELS, at = i % blocks * DPR_BLUR_BLOCK;
  global const float4* lines[DPR_BLUR_PIXELS];
  for (uint lane = 0; lane < DPR_BLUR_PIXELS; ++lane)
    lines[lane] = in + (size_t)min(first + lane, p.lines - 1) * p.in_length;
  const uint steps = min(p.out_length - at, (uint)DPR_BLUR_BLOCK),
             count = min(p.lines - first, (uint)DPR_BLUR_PIXELS);
  const BlurTaps t = block_taps(p, (int)at, DPR_BLUR_BLOCK);
  pixels_n sums[DPR_BLUR_BLOCK];
  if (is_outside_rows(p, first, count, (int)at, (int)steps, extents)) {
    fill_sums(join_lines(lines, t.from), sums);
  } else {
    fill_sums((pixels_n)(0.0f), sums);
    for (int k = t.from; k < t.to; ++k)
      add_to_sums(weights + (t.last - k * p.in_step), p.out_step, join_lines(lines, k), sums);
  }
#pragma unroll
  for (uint step = 0; step < DPR_BLUR_BLOCK; ++step) {
    if (step >= steps) break;
    float4 lanes[DPR_BLUR_PIXELS];
    store_lanes(sums[step], lanes);
    for (uint lane = 0; lane < count; ++lane)
      out[(size_t)(first + lane) * p.out_length + at + step] = lanes[lane];
  }
}
