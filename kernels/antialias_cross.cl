// Contours between samples. Where a contour crosses the step between two neighbouring samples, at the
// fraction t of the way, each takes a part of the other's colour (crossing.h): the image follows the contour,
// and dI/dt is the jump across it (Reynolds' transport theorem; Li,
// Aittala, Durand & Lehtinen, "Differentiable Monte Carlo ray tracing through edge sampling", 2018, eq. (5);
// on a raster Laine et al., "Modular primitives for high-performance differentiable rendering", 2020, section
// 3.6). Here every contour walks its own crossings, so that none is missed however small its triangles are.
//
// Steep edges are crossed along rows, flat ones along columns, and those between partly along both, so that
// each piece of a contour counts once. A step belongs to its first sample, the left or the upper one: planes
// [2][view][height][width], to the right and down. Of several contours in a step, one that occludes goes
// before a crease, then the nearest, then the first.
//
// A contour is hidden where the sample on its outer side shows what is nearer. Its inner side is not asked
// for its depth: at a smooth silhouette the surface rises steeply towards the camera there, and what hides
// the contour on that side alone has a contour of its own in the same step, which is nearer.
//
// What crosses a step that another contour wins is left to antialias_second.cl.
#include "nearest.h"
#include "visibility.h"

/// A fragment of that ln p or more is not seen through.
#define DPR_LOG_OPAQUE -5e-7f

/// What hides contours from samples near them: the front-most surface or, where `layers` are told apart, the
/// last of these, since what lies before it may be seen through; or, of 0 layers, the first that is opaque. One
/// work-item per DPR_ROWS of a tile of the band, whose tiles are [get_global_offset(), p.last_tile). Deterministic.
/// in   tile_starts  uint[view * tile + 1]  runs of contours' pairs
/// in   starts       uint[pixel + 1]        runs of `list`
/// in   list         uint[...]              fragments, by pixel
/// in   fragments    float[plane][fragment]  DEPTH; with 0 layers, LOG_OCCUPANCY
/// in   fragment_pair, pair_face            uint[fragment], uint[pair]
/// out  front        float[pixel]           not written in tiles further than one from a contour. INFINITY
///                                          where there are fewer surfaces
/// out  front_face   uint[pixel]            the same, of what surfaces there are; view * faces + face,
///                                          DPR_NO_FACE where there is none
kernel void antialias_front(const FrameParams p, const uint layers, global const uint* restrict tile_starts,
                            global const uint* restrict starts, global const uint* restrict list,
                            global const float* restrict fragments, global const uint* restrict fragment_pair,
                            global const uint* restrict pair_face, global float* restrict front,
                            global uint* restrict front_face) {
  const TileRows rows = tile_rows(p, (uint)get_global_id(0));
  if (rows.first >= rows.last || !is_near_contour(p, rows.tile, 1, tile_starts)) return;
  for (uint row = rows.first; row < rows.last; ++row) {
    const uint first = place_of_sample(p, rows.view, rows.first_column, row);
    for (uint pixel = first; pixel < first + rows.columns; ++pixel) {
      DepthLayer surface = before_surfaces();
      uint face = DPR_NO_FACE;
      for (uint layer = 0; (layers == 0 || layer < layers) && is_surface(surface); ++layer) {
        surface = next_behind(surface, pixel, starts, list, fragments + DPR_PLANE(p, DEPTH));
        if (!is_surface(surface)) break;
        const uint k = list[surface.place];
        face = pair_face[fragment_pair[k]];
        if (layers == 0 && fragments[k + DPR_PLANE(p, LOG_OCCUPANCY)] >= DPR_LOG_OPAQUE) break;
      }
      front[pixel] = surface.depth;
      front_face[pixel] = face;
    }
  }
}

/// True if a contour goes before the one that a step has.
static inline int goes_before(uint before, float before_depth, uint contour, float depth) {
  const int creases = is_crease(contour), before_creases = is_crease(before);
  return creases < before_creases || (creases == before_creases && depth < before_depth);
}

/// The depth at which a contour crosses a line. Found again where another contests its step: a place for each
/// step's would be in memory.
static inline float depth_on_line(const FrameParams p, const TileContour c, int by_rows, int line) {
  return mix_depths(p, c.depths, along_edge(p, raster_edge(c.a, c.b, by_rows), line));
}

static inline void clear_in_row(int count, global uint* restrict steps) {
  if (count == DPR_TILE) {
    vstore8((uint8)(DPR_NO_CROSSING), 0, steps);
    return;
  }
  for (int k = 0; k < count; ++k) steps[k] = DPR_NO_CROSSING;
}

static inline void clear_steps(const FrameParams p, const TileSamples s, const TileLines own, uint view,
                               global uint* restrict winner) {
  const int first_row = s.first_row + own.first, first_column = s.first_column + own.first,
            last_column = min(s.first_column + own.last, s.last_column);
  for (int row = first_row; row < min(s.first_row + own.last, s.last_row); ++row)
    clear_in_row(s.last_column - s.first_column,
                 winner + place_of_sample(p, view, (uint)s.first_column, (uint)row));
  for (int row = s.first_row; row < s.last_row; ++row)
    clear_in_row(last_column - first_column,
                 winner + samples_of_window(p) + place_of_sample(p, view, (uint)first_column, (uint)row));
}

/// Finds what crosses the steps of a tile. One work-item per DPR_ROWS rows, and as many columns, of a tile.
/// Deterministic.
/// in   edges         uint2[edge]           of the scene; see DPR_EDGE_FLAG
/// in   faces         uint4[face]           vertex indices
/// in   ndc           float4[view][vertex]
/// in   clipped       ClippedFace[view][face]  read where p.clips is set
/// in   tile_starts   uint[view * tile + 1] runs of pairs
/// in   pair_contour  uint[pair]            see DPR_CONTOUR_FLAGS, ascending within a tile
/// in   front         float[pixel]
/// out  winner        uint[2][pixel]        the contour that crosses a step, DPR_PASSED, or DPR_NO_CROSSING.
///                                          Not written in tiles further than two from a contour: nothing
///                                          asks for their steps
/// out  cut           Cut[2][pixel]         what it cuts. Not written where nothing crosses
/// out  crowded       uchar[tile][DPR_TILE_BYTES]  steps that several contours cross. Not written where the
///                                          winners are not
kernel void antialias_cross(const FrameParams p, global const ViewParams* restrict views,
                            global const uint2* restrict edges, global const uint4* restrict faces,
                            global const float4* restrict ndc, global const ClippedFace* restrict clipped,
                            global const uint* restrict tile_starts, global const uint* restrict pair_contour,
                            global const float* restrict front, global uint* restrict winner,
                            global float2* restrict cut, global uchar* restrict crowded) {
  const TileLines own = tile_lines((uint)get_global_id(0));
  const uint tile = own.tile, view = tile / (p.tiles_x * p.tiles_y);
  if (tile >= p.last_tile || !is_near_contour(p, tile, 2, tile_starts)) return;
  const TileSamples s = tile_samples(p, tile);
  clear_steps(p, s, own, view, winner);
  const CrossingScene v = {faces, ndc, front, place_of_sample(p, view, 0, 0),
                           p.depth_reach / views[view].inverse_range};
  ulong several_right = 0, several_down = 0;  // steps, a bit each
  for (uint pair = tile_starts[tile]; pair < tile_starts[tile + 1]; ++pair) {
    const uint contour = pair_contour[pair];
    if (is_left_out(p, contour)) continue;
    const TileContour c = load_contour(p, contour, edges, faces, ndc, clipped);
    for (int by_rows = 0; by_rows < 2; ++by_rows) {
      const RasterEdge e = raster_edge(c.a, c.b, by_rows);
      const int only_passes = weight_of_slope(e.slope * e.slope) == 0.0f;
      const int2 lines = own_lines_of_edge(p, e, s, own);
      for (int line = lines.x; line < lines.y; ++line) {
        const Crossing x = cross_line(p, e, line);
        if (!is_step_of(p, e, x, s)) continue;
        const uint step = step_of(p, view, e, x), before = winner[step];
        const ulong bit = 1ul << bit_in_tile(e, x);
        const float depth = mix_depths(p, c.depths, x.along);
        int loses = is_contour(before);
        if (loses && !only_passes) {
          const TileContour other = load_contour(p, before, edges, faces, ndc, clipped);
          loses = !goes_before(before, depth_on_line(p, other, by_rows, line), contour, depth);
        }
        if (loses && ((by_rows ? several_right : several_down) & bit)) continue;
        const int hidden = hidden_from(p, v, c, e, x, is_crease(contour), depth);
        if (hidden == 2) continue;
        if (before != DPR_NO_CROSSING) {
          several_right |= by_rows ? bit : 0;
          several_down |= by_rows ? 0 : bit;
        }
        if (loses) continue;
        // A crease is there but wins nothing where one of the samples shows a surface beyond another
        // contour.
        if (only_passes || hidden) {
          if (before == DPR_NO_CROSSING) winner[step] = DPR_PASSED;
          continue;
        }
        winner[step] = contour;
        cut[step] = cut_of(p, c, e, x);
      }
    }
  }
  global uchar* bytes = crowded + DPR_TILE_BYTES * (tile - p.first_tile);
  for (int line = own.first; line < own.last; ++line) {
    bytes[line] = (uchar)(several_right >> DPR_TILE * line);
    bytes[DPR_TILE + line] = (uchar)(several_down >> DPR_TILE * line);
  }
}

/// The gradient of what a contour cuts at a step of a tile, as its winner or as a second.
static inline Cut gradient_of_cut(uint contour, uint step, uint list, global const uint* restrict winner,
                                  global const float2* restrict grad_cut,
                                  global const uint* restrict second_counts,
                                  global const SecondCrossing* restrict seconds,
                                  global const float2* restrict grad_seconds) {
  if (winner[step] == contour) return grad_cut[step];
  const uint place = place_of_second(contour, step, list, second_counts, seconds);
  return place != DPR_NO_CROSSING ? grad_seconds[place] : (Cut)(0.0f);
}

/// The gradients of the ends of contours: each walks its own crossings again, and takes those of the steps
/// that it won, or crosses as a second. One work-item per pair; pairs of tiles that are not of the launch are left
/// out. Deterministic.
/// in   edges, faces, ndc, clipped, winner  as antialias_cross
/// in   pairs          uint[1]          how many there are
/// in   pair_contour   uint[pair]
/// in   pair_tile      uint[pair]       view * tiles + tile
/// in   grad_cut       Cut[2][pixel]
/// in   second_counts, seconds, grad_seconds  as antialias_second.cl leaves them
/// out  grad_ends      float4[pair]     of x, y of the first end, x, y of the second, NDC
kernel void antialias_cross_backward(
    const FrameParams p, global const uint* restrict pairs, global const uint2* restrict edges,
    global const uint4* restrict faces, global const float4* restrict ndc,
    global const ClippedFace* restrict clipped, global const uint* restrict pair_contour,
    global const uint* restrict pair_tile, global const uint* restrict winner,
    global const float2* restrict grad_cut, global const uint* restrict second_counts,
    global const SecondCrossing* restrict seconds, global const float2* restrict grad_seconds,
    global float4* restrict grad_ends) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= pairs[0] || pair_tile[pair] < p.begin_tile || pair_tile[pair] >= p.last_tile) return;
  const uint contour = pair_contour[pair];
  const TileContour c = load_contour(p, contour, edges, faces, ndc, clipped);
  const TileSamples s = tile_samples(p, pair_tile[pair]);
  float2 grad_a = 0.0f, grad_b = 0.0f;
  for (int by_rows = 0; by_rows < 2; ++by_rows) {
    const RasterEdge e = raster_edge(c.a, c.b, by_rows);
    if (weight_of_slope(e.slope * e.slope) == 0.0f) continue;
    const int2 lines = lines_of_edge(p, e, s);
    float at_a = 0.0f, at_b = 0.0f, across_a = 0.0f, across_b = 0.0f, of_slope2 = 0.0f;
    for (int line = lines.x; line < lines.y; ++line) {
      const Crossing x = cross_line(p, e, line);
      if (!is_step_of(p, e, x, s)) continue;
      const uint list = list_of_line(p, pair_tile[pair], line);
      const Cut grad_of = gradient_of_cut(contour, step_of(p, c.view, e, x), list, winner, grad_cut,
                                          second_counts, seconds, grad_seconds);
      const float grad = grad_of.x;
      of_slope2 += grad_of.y;
      if (grad == 0.0f) continue;
      const CornerArea first = corner_of(p, c, e, x, 0), second = corner_of(p, c, e, x, 1);
      at_a += grad *
              (1.0f - x.along + first.height * (1.0f - first.along) + second.height * (1.0f - second.along));
      at_b += grad * (x.along + first.height * first.along + second.height * second.along);
      across_a += grad * first.width;
      across_b += grad * second.width;
    }
    // Rows count downwards. A crossing stays on its line: where an end moves along the edge, it does not
    // move.
    const float scale = (by_rows ? 1.0f : -1.0f) / p.pixel_size;
    const float2 direction = by_rows ? (float2)(1.0f, -e.slope) : (float2)(-e.slope, 1.0f);
    const float2 across = by_rows ? (float2)(0.0f, -1.0f) : (float2)(-1.0f, 0.0f);
    const float2 by_slope = 2.0f * of_slope2 * e.slope * e.inverse * direction;
    grad_a += scale * (at_a * direction + across_a * across) - by_slope;
    grad_b += scale * (at_b * direction + across_b * across) + by_slope;
  }
  grad_ends[pair] = (float4)(grad_a, grad_b);
}
