// Forward mode of antialias_cross.cl, antialias_fade.cl, antialias.cl and antialias_second.cl, along one
// direction: tangents of the samples that contours blend.
#include "blended.h"
#include "faded.h"
#include "second.h"

/// Tangent, NDC, of an end of an edge: a vertex, or a cut. Cuts are the outline's last two corners.
static inline float2 end_tangent(const EdgeScene s, const ViewEdge e, uint end, global const float4* vertices,
                                 global const float4* outlines) {
  const uint cut = end == 0 ? e.cut[0] : e.cut[1];
  if (cut == DPR_NO_CUT) return vertices[end == 0 ? e.record.x : e.record.y].xy;
  return outlines[4 * e.cut_face + s.clipped[e.cut_face].corners - 2 + cut].xy;
}

/// The tangent of what a contour cuts at a crossing, by those of its ends: antialias_cross_backward, transposed.
static inline Cut tangent_of_cut(const FrameParams p, const TileContour c, const RasterEdge e,
                                 const Crossing x, float2 move_a, float2 move_b) {
  const float scale = (e.is_by_rows ? 1.0f : -1.0f) / p.pixel_size;
  const float2 direction = e.is_by_rows ? (float2)(1.0f, -e.slope) : (float2)(-e.slope, 1.0f);
  const float2 across = e.is_by_rows ? (float2)(0.0f, -1.0f) : (float2)(-1.0f, 0.0f);
  const CornerArea first = corner_of(p, c, e, x, 0), second = corner_of(p, c, e, x, 1);
  const float at_a =
      1.0f - x.along + first.height * (1.0f - first.along) + second.height * (1.0f - second.along);
  const float at_b = x.along + first.height * first.along + second.height * second.along;
  return (Cut)(scale * (at_a * dot(direction, move_a) + at_b * dot(direction, move_b) +
                        first.width * dot(across, move_a) + second.width * dot(across, move_b)),
               2.0f * e.slope * e.inverse * dot(direction, move_b - move_a));
}

/// Tangents of what contours cut. One work-item per pair. Deterministic. Inputs as antialias_cross_backward, and
/// in   direction_pairs  the direction, and how many pairs there are
/// in   vertices       float4[direction][view][vertex]  of x, y (NDC) and view depth
/// in   outlines       as clip_outline_tangent leaves them, read where p.clips is set
/// out  cut_tangents   Cut[2][pixel]  of the steps' winners; then Cut[list][DPR_SECOND_ROOM]  of the seconds
kernel void antialias_cross_tangent(
    const FrameParams p, const uint2 direction_pairs, global const uint2* restrict edges,
    global const uint4* restrict faces, global const float4* restrict ndc,
    global const ClippedFace* restrict clipped, global const uint* restrict pair_contour,
    global const uint* restrict pair_tile, global const uint* restrict winner,
    global const uint* restrict second_counts, global const SecondCrossing* restrict seconds,
    global const float4* restrict vertices, global const float4* restrict outlines,
    global float2* restrict cut_tangents) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= direction_pairs.y) return;
  const uint contour = pair_contour[pair];
  const TileContour c = load_contour(p, contour, edges, faces, ndc, clipped);
  const EdgeScene scene = edges_of_view(p, c.view, edges, faces, ndc, clipped);
  const ViewEdge edge = view_edge(scene, contour / DPR_CONTOUR_FLAGS - c.view * p.edges);
  const size_t of_view = (size_t)direction_pairs.x * p.views + c.view;
  global const float4 *move = vertices + of_view * p.vertices,
                      *outline_move = outlines + (p.clips ? 4 * of_view * p.faces : 0);
  const float2 move_a = end_tangent(scene, edge, 0, move, outline_move);
  const float2 move_b = end_tangent(scene, edge, 1, move, outline_move);
  const TileSamples s = tile_samples(p, pair_tile[pair]);
  for (int by_rows = 0; by_rows < 2; ++by_rows) {
    const RasterEdge e = raster_edge(c.a, c.b, by_rows);
    const int counts = weight_of_slope(e.slope * e.slope) != 0.0f;
    const int2 lines = lines_of_edge(p, e, s);
    for (int line = lines.x; line < lines.y; ++line) {
      const Crossing x = cross_line(p, e, line);
      if (!is_step_of(p, e, x, s)) continue;
      const uint step = step_of(p, c.view, e, x);
      const Cut moved = counts ? tangent_of_cut(p, c, e, x, move_a, move_b) : (Cut)(0.0f);
      if (winner[step] == contour) {
        cut_tangents[step] = moved;
        continue;
      }
      const uint list = list_of_line(p, pair_tile[pair], line);
      const uint first = DPR_SECOND_ROOM * list, last = first + second_counts[list];
      for (uint k = first; k < last; ++k) {
        if (seconds[k].step == step && seconds[k].contour == contour)
          cut_tangents[2 * samples_of_window(p) + k] = moved;
      }
    }
  }
}

/// The tangent of a cut at a step.
static inline Cut moved_at(const FrameParams p, const Steps steps, Sample s, int step,
                           global const float2* cut_tangents) {
  return cut_tangents[place_of(p, steps, s, step)];
}

/// What moving contours add to a faded sample's tangent at one of the steps that fade it.
static inline float4 moved_share(const FrameParams p, const Steps steps, Sample s, const Fading f, int step,
                                 float4 own, global const float4* raster, global const float2* cut_tangents) {
  if (step < 0) return 0.0f;
  const float share = dot(share_faded_gradient(cut_at(p, steps, s, step), turn_of(step)),
                          moved_at(p, steps, s, step, cut_tangents));
  return f.limit * share * (continued_to(p, steps, s, step, raster) - own);
}

/// Tangents of faded samples, near contours. One work-item per DPR_ROWS of a tile. Deterministic.
/// in   tile_starts, winner, cut  as antialias_fade has them
/// in   raster           float4[pixel]  the samples as they were kept
/// in   cut_tangents     Cut[2][pixel]
/// in   raster_tangents  float4[pixel]  of the samples
/// out  faded_tangents   float4[pixel]  not written in tiles further than one from a contour
kernel void antialias_fade_tangent(const FrameParams p, global const uint* restrict tile_starts,
                                   global const uint* restrict winner, global const float2* restrict cut,
                                   global const float4* restrict raster,
                                   global const float2* restrict cut_tangents,
                                   global const float4* restrict raster_tangents,
                                   global float4* restrict faded_tangents) {
  const TileRows rows = tile_rows(p, (uint)get_global_id(0));
  if (rows.first >= rows.last || !is_near_contour(p, rows.tile, 1, tile_starts)) return;
  const Steps steps = {winner, cut, samples_of_window(p)};
  for (uint row = rows.first; row < rows.last; ++row) {
    const TileRow r = row_of(p, rows, row);
    if (touched_in_row(p, steps, r, 3) == 0) continue;
    copy_row(r, raster_tangents, faded_tangents);
    for (uint touched = touched_in_row(p, steps, r, 1); touched != 0; touched &= touched - 1) {
      const Sample s = sample_of(r, lowest_bit(touched));
      const Fading f = fading_of(p, steps, s);
      const float4 own = f.limit < 1.0f ? faded(p, steps, s, f, raster) : raster[s.index];
      faded_tangents[s.index] = faded(p, steps, s, f, raster_tangents) +
                                moved_share(p, steps, s, f, f.step.x, own, raster, cut_tangents) +
                                moved_share(p, steps, s, f, f.step.y, own, raster, cut_tangents);
    }
  }
}

/// The tangents of the parts that a sample takes at a step.
static inline Parts moved_parts(Cut cut, float turn, Cut moved) {
  return (Parts)(dot(parts_taken_gradient(cut, turn, (Parts)(1.0f, 0.0f)), moved),
                 dot(parts_taken_gradient(cut, turn, (Parts)(0.0f, 1.0f)), moved));
}

/// The tangent of what contours add to a sample.
static inline float4 moved_addition(const FrameParams p, const Steps steps, Sample s,
                                    global const float4* raster, global const float2* cut_tangents,
                                    global const float4* faded_tangents) {
  float4 sum = 0.0f, moved_sum = 0.0f;
  float total = 0.0f, moved_total = 0.0f;
#pragma unroll 1
  for (int k = 0; k < DPR_STEPS; ++k) {
    if (!is_contour(at_step(p, steps, s, k))) continue;
    const Cut cut = cut_at(p, steps, s, k);
    const Parts parts = parts_taken(cut, turn_of(k)),
                moved = moved_parts(cut, turn_of(k), moved_at(p, steps, s, k, cut_tangents));
    const Taken taken = taken_at(p, steps, s, k, raster), move = taken_at(p, steps, s, k, faded_tangents);
    sum += parts.x * taken.difference + parts.y * taken.changes;
    total += parts.x;
    moved_sum += parts.x * move.difference + parts.y * move.changes + moved.x * taken.difference +
                 moved.y * taken.changes;
    moved_total += moved.x;
  }
  return total > 1.0f ? (moved_sum - sum * (moved_total / total)) / total : moved_sum;
}

/// Tangents of blended samples. One work-item per DPR_ROWS of a tile. Deterministic.
/// in      tile_starts, winner, cut  as antialias_forward has them
/// in      raster           float4[pixel]  the faded samples
/// in      cut_tangents     Cut[2][pixel]
/// in      faded_tangents   float4[pixel]  as antialias_fade_tangent leaves them
/// in out  tangents         float4[pixel]  of the samples, near contours replaced
kernel void antialias_blend_tangent(const FrameParams p, global const uint* restrict tile_starts,
                                    global const uint* restrict winner, global const float2* restrict cut,
                                    global const float4* restrict raster,
                                    global const float2* restrict cut_tangents,
                                    global const float4* restrict faded_tangents,
                                    global float4* restrict tangents) {
  const TileRows rows = tile_rows(p, (uint)get_global_id(0));
  if (rows.first >= rows.last || !may_be_crossed(p, rows.tile, tile_starts)) return;
  const Steps steps = {winner, cut, samples_of_window(p)};
  for (uint row = rows.first; row < rows.last; ++row) {
    const TileRow r = row_of(p, rows, row);
    for (uint touched = touched_in_row(p, steps, r, 1); touched != 0; touched &= touched - 1) {
      const Sample s = sample_of(r, lowest_bit(touched));
      tangents[s.index] =
          faded_tangents[s.index] + moved_addition(p, steps, s, raster, cut_tangents, faded_tangents);
    }
  }
}

/// The tangent of a second's jump.
static inline float4 moved_jump(const FrameParams p, const Steps steps, const SecondCrossing c,
                                global const float4* raster, global const float2* cut_tangents,
                                global const float4* faded_tangents) {
  const float4 linear = jump_of(p, steps, c, faded_tangents);
  if (c.reference < DPR_SAMPLE_PAIRS) return linear;
  const Reference r = load_reference(p, steps, c.reference);
  const float4 changes = change_towards(p, steps, r.first, r.step, raster) +
                         change_towards(p, steps, r.second, DPR_OPPOSITE(r.step), raster);
  return linear + turn_of(r.step) * cut_tangents[r.place].x * changes;
}

/// Adds the tangents of what the seconds' jumps have added. One work-item per DPR_ROWS of a tile. Deterministic.
/// Inputs as antialias_second_forward, and
/// in      cut_tangents     as antialias_cross_tangent leaves them
/// in      faded_tangents   float4[pixel]
/// in out  tangents         float4[pixel]
kernel void antialias_second_tangent(const FrameParams p, global const uint* restrict tile_starts,
                                     global const uint* restrict counts,
                                     global const SecondCrossing* restrict seconds,
                                     global const uint* restrict winner, global const float2* restrict cut,
                                     global const float4* restrict raster,
                                     global const float2* restrict cut_tangents,
                                     global const float4* restrict faded_tangents,
                                     global float4* restrict tangents) {
  const TileRows rows = tile_rows(p, (uint)get_global_id(0));
  if (rows.first >= rows.last || !is_near_contour(p, rows.tile, DPR_NEAR_TILES, tile_starts)) return;
  const Steps steps = {winner, cut, samples_of_window(p)};
  const NearTiles tiles = near_tiles(p, rows.tile, DPR_NEAR_TILES);
  for (uint i = 0; i < near_lists(tiles); ++i) {
    const uint list = near_list(p, tiles, i);
    for (uint k = 0; k < counts[list]; ++k) {
      const uint place = DPR_SECOND_ROOM * list + k;
      const SecondCrossing c = seconds[place];
      const uint2 samples = ends_of_step(p, c.step);
      const int has_first = is_in_rows(p, rows, samples.x), has_second = is_in_rows(p, rows, samples.y);
      if (!has_first && !has_second) continue;
      const Cut first = cut[c.step], moved_first = cut_tangents[c.step],
                moved = cut_tangents[2 * steps.pixels + place];
      const float2 parts = parts_gained(c, first);
      const float2 moved_gain =
          (float2)(moved_parts(own_cut(c), -1.0f, moved).x - moved_parts(first, -1.0f, moved_first).x,
                   moved_parts(first, 1.0f, moved_first).x - moved_parts(own_cut(c), 1.0f, moved).x);
      const float4 jump = jump_of(p, steps, c, raster);
      const float4 move = moved_jump(p, steps, c, raster, cut_tangents, faded_tangents);
      if (has_first) tangents[samples.x] += parts.x * move + moved_gain.x * jump;
      if (has_second) tangents[samples.y] += parts.y * move + moved_gain.y * jump;
    }
  }
}
