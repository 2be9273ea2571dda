// Forward mode of antialias_cross.cl, antialias_fade.cl, antialias.cl and antialias_second.cl: tangents of the
// samples that contours blend, along all directions, which share what they are multiplied with.
#include "blended.h"
#include "faded.h"
#include "second.h"

/// The gradients of a cut by the ends of its contour: of its area, and of its squared slope, for which the first
/// end's is the second's negative. As antialias_cross_backward has them.
typedef struct {
  float2 area[2], slope;
} CutByEnds;

static inline CutByEnds cut_by_ends(const FrameParams p, const TileContour c, const RasterEdge e,
                                    const Crossing x) {
  const float scale = (e.is_by_rows ? 1.0f : -1.0f) / p.pixel_size;
  const float2 direction = e.is_by_rows ? (float2)(1.0f, -e.slope) : (float2)(-e.slope, 1.0f);
  const float2 across = e.is_by_rows ? (float2)(0.0f, -1.0f) : (float2)(-1.0f, 0.0f);
  const CornerArea first = corner_of(p, c, e, x, 0), second = corner_of(p, c, e, x, 1);
  const float at_a =
      1.0f - x.along + first.height * (1.0f - first.along) + second.height * (1.0f - second.along);
  const float at_b = x.along + first.height * first.along + second.height * second.along;
  CutByEnds by;
  by.area[0] = scale * (at_a * direction + first.width * across);
  by.area[1] = scale * (at_b * direction + second.width * across);
  by.slope = 2.0f * e.slope * e.inverse * direction;
  return by;
}

/// Tangents of an edge's ends, of all directions.
typedef struct {
  global const float4* first[2];
  size_t stride[2];  // from one direction to the next
} EndTangents;

static inline EndTangents end_tangents(const FrameParams p, const EdgeScene s, const ViewEdge e, uint view,
                                       global const float4* vertices, global const float4* outlines) {
  EndTangents t;
#pragma unroll
  for (int end = 0; end < 2; ++end) {
    const uint cut = e.cut[end];
    // Cuts are the outline's last two corners.
    const int is_cut = cut != DPR_NO_CUT;
    const size_t corner = is_cut     ? 4 * (size_t)e.cut_face + s.clipped[e.cut_face].corners - 2 + cut
                          : end == 0 ? e.record.x
                                     : e.record.y;
    t.first[end] = is_cut ? outlines + (4 * (size_t)view * p.faces + corner)
                          : vertices + ((size_t)view * p.vertices + corner);
    t.stride[end] = (size_t)p.views * (is_cut ? 4 * (size_t)p.faces : p.vertices);
  }
  return t;
}

/// Where the tangents of the cut at a step, or of a second, begin: one of each direction.
static inline size_t moved_step(uint directions, size_t step) { return step * directions; }
static inline size_t moved_second(const FrameParams p, uint directions, uint second) {
  return (2 * (size_t)samples_of_window(p) + second) * directions;
}

/// Tangents of what contours cut. One work-item per pair. Deterministic. Inputs as antialias_cross_backward, and
/// in   directions_pairs  how many there are
/// in   vertices       float4[direction][view][vertex]  of x, y (NDC) and view depth
/// in   outlines       as clip_outline_tangent leaves them, read where p.clips is set
/// out  cut_tangents   Cut[2][pixel][direction]  of the steps' winners; then Cut[list][DPR_SECOND_ROOM][direction]
///                     of the seconds
kernel void antialias_cross_tangent(
    const FrameParams p, const uint2 directions_pairs, global const uint2* restrict edges,
    global const uint4* restrict faces, global const float4* restrict ndc,
    global const ClippedFace* restrict clipped, global const uint* restrict pair_contour,
    global const uint* restrict pair_tile, global const uint* restrict winner,
    global const uint* restrict second_counts, global const SecondCrossing* restrict seconds,
    global const float4* restrict vertices, global const float4* restrict outlines,
    global float2* restrict cut_tangents) {
  const uint pair = (uint)get_global_id(0), directions = directions_pairs.x;
  if (pair >= directions_pairs.y) return;
  const uint contour = pair_contour[pair];
  const TileContour c = load_contour(p, contour, edges, faces, ndc, clipped);
  const EdgeScene scene = edges_of_view(p, c.view, edges, faces, ndc, clipped);
  const ViewEdge edge = view_edge(scene, contour / DPR_CONTOUR_FLAGS - c.view * p.edges);
  const EndTangents ends = end_tangents(p, scene, edge, c.view, vertices, outlines);
  const TileSamples s = tile_samples(p, pair_tile[pair]);
  for (int by_rows = 0; by_rows < 2; ++by_rows) {
    const RasterEdge e = raster_edge(c.a, c.b, by_rows);
    const int counts = weight_of_slope(e.slope * e.slope) != 0.0f;
    const int2 lines = lines_of_edge(p, e, s);
    for (int line = lines.x; line < lines.y; ++line) {
      const Crossing x = cross_line(p, e, line);
      if (!is_step_of(p, e, x, s)) continue;
      const uint step = step_of(p, c.view, e, x);
      size_t place = moved_step(directions, step);
      if (winner[step] != contour) {
        const uint list = list_of_line(p, pair_tile[pair], line);
        const uint second = place_of_second(contour, step, list, second_counts, seconds);
        if (second == DPR_NO_CROSSING) continue;
        place = moved_second(p, directions, second);
      }
      const CutByEnds by = cut_by_ends(p, c, e, x);
      for (uint d = 0; d < directions; ++d) {
        const float2 move_a = ends.first[0][d * ends.stride[0]].xy,
                     move_b = ends.first[1][d * ends.stride[1]].xy;
        cut_tangents[place + d] =
            counts ? (Cut)(dot(by.area[0], move_a) + dot(by.area[1], move_b), dot(by.slope, move_b - move_a))
                   : (Cut)(0.0f);
      }
    }
  }
}

/// What a faded sample's tangent gains from the cut at one of the steps that fade it: the share's gradient, times
/// the colour that takes its place.
typedef struct {
  int is_there;
  size_t place;  // of the cut's tangents
  Cut by_cut;
  float4 difference;
} FadingBy;

static inline FadingBy fading_by(const FrameParams p, const Steps steps, Sample s, const Fading f, int step,
                                 float4 own, uint directions, global const float4* raster) {
  FadingBy by = {step >= 0, 0, (Cut)(0.0f), (float4)(0.0f)};
  if (!by.is_there) return by;
  by.place = moved_step(directions, place_of(p, steps, s, step));
  by.by_cut = f.limit * share_faded_gradient(cut_at(p, steps, s, step), turn_of(step));
  by.difference = continued_to(p, steps, s, step, raster) - own;
  return by;
}

static inline float4 moved_share(const FadingBy by, uint direction, global const float2* cut_tangents) {
  return by.is_there ? dot(by.by_cut, cut_tangents[by.place + direction]) * by.difference : (float4)(0.0f);
}

/// Tangents of faded samples, near contours. One work-item per DPR_ROWS of a tile. Deterministic.
/// in   tile_starts, winner, cut  as antialias_fade has them
/// in   raster           float4[pixel]  the samples as they were kept
/// in   cut_tangents     Cut[2][pixel][direction]
/// in   raster_tangents  float4[direction][pixel]  of the samples
/// out  faded_tangents   float4[direction][pixel]  not written in tiles further than one from a contour
kernel void antialias_fade_tangent(const FrameParams p, const uint directions,
                                   global const uint* restrict tile_starts,
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
    for (uint d = 0; d < directions; ++d) {
      const size_t of = (size_t)d * steps.pixels;
      copy_row(r, raster_tangents + of, faded_tangents + of);
    }
    for (uint touched = touched_in_row(p, steps, r, 1); touched != 0; touched &= touched - 1) {
      const Sample s = sample_of(r, lowest_bit(touched));
      const Fading f = fading_of(p, steps, s);
      if (f.step.x < 0 && f.step.y < 0) continue;
      const float4 own = f.limit < 1.0f ? faded(p, steps, s, f, raster) : raster[s.index];
      const FadingBy by_x = fading_by(p, steps, s, f, f.step.x, own, directions, raster),
                     by_y = fading_by(p, steps, s, f, f.step.y, own, directions, raster);
      for (uint d = 0; d < directions; ++d) {
        const size_t of = (size_t)d * steps.pixels;
        faded_tangents[of + s.index] = faded(p, steps, s, f, raster_tangents + of) +
                                       moved_share(by_x, d, cut_tangents) +
                                       moved_share(by_y, d, cut_tangents);
      }
    }
  }
}

/// The tangents of the parts that a sample takes at a step: their gradients, times the cut's tangent.
typedef struct {
  Cut first, second;
} PartsByCut;

static inline PartsByCut parts_by_cut(Cut cut, float turn) {
  const PartsByCut by = {parts_taken_gradient(cut, turn, (Parts)(1.0f, 0.0f)),
                         parts_taken_gradient(cut, turn, (Parts)(0.0f, 1.0f))};
  return by;
}

/// Adds the tangents of what a sample takes at a step. That of a / total is (a' - a / total * total') / total.
static inline void add_moved(const FrameParams p, const Steps steps, Sample s, int step, const Addition all,
                             uint directions, global const float4* raster, global const float2* cut_tangents,
                             global const float4* faded_tangents, global float4* tangents) {
  const Cut cut = cut_at(p, steps, s, step);
  const Parts parts = parts_taken(cut, turn_of(step));
  const PartsByCut by = parts_by_cut(cut, turn_of(step));
  const Taken taken = taken_at(p, steps, s, step, raster);
  const int is_full = all.total > 1.0f;
  const float part = is_full ? 1.0f / all.total : 1.0f;
  const float4 first = is_full ? taken.difference - all.sum * part : taken.difference;
  const size_t place = moved_step(directions, place_of(p, steps, s, step));
  for (uint d = 0; d < directions; ++d) {
    const size_t of = (size_t)d * steps.pixels;
    const Cut moved = cut_tangents[place + d];
    const Taken move = taken_at(p, steps, s, step, faded_tangents + of);
    tangents[of + s.index] += part * (parts.x * move.difference + parts.y * move.changes +
                                      dot(by.first, moved) * first + dot(by.second, moved) * taken.changes);
  }
}

/// Tangents of blended samples. One work-item per DPR_ROWS of a tile. Deterministic.
/// in      tile_starts, winner, cut  as antialias_forward has them
/// in      raster           float4[pixel]  the faded samples
/// in      cut_tangents     Cut[2][pixel][direction]
/// in      faded_tangents   float4[direction][pixel]  as antialias_fade_tangent leaves them
/// in out  tangents         float4[direction][pixel]  of the samples, near contours replaced
kernel void antialias_blend_tangent(const FrameParams p, const uint directions,
                                    global const uint* restrict tile_starts,
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
      for (uint d = 0; d < directions; ++d) {
        const size_t of = (size_t)d * steps.pixels + s.index;
        tangents[of] = faded_tangents[of];
      }
      const Addition all = addition_of(p, steps, s, raster);
#pragma unroll 1
      for (int k = 0; k < DPR_STEPS; ++k) {
        if (!is_contour(at_step(p, steps, s, k))) continue;
        add_moved(p, steps, s, k, all, directions, raster, cut_tangents, faded_tangents, tangents);
      }
    }
  }
}

/// How a second's jump follows the cut at its reference, where it has one.
typedef struct {
  int is_there;
  size_t place;  // of the cut's tangents
  float4 by_cut;
} Change;

static inline Change change_of_jump(const FrameParams p, const Steps steps, const SecondCrossing c,
                                    uint directions, global const float4* raster) {
  Change change = {c.reference >= DPR_SAMPLE_PAIRS, 0, (float4)(0.0f)};
  if (!change.is_there) return change;
  const Reference r = load_reference(p, steps, c.reference);
  change.place = moved_step(directions, r.place);
  change.by_cut = turn_of(r.step) * (change_towards(p, steps, r.first, r.step, raster) +
                                     change_towards(p, steps, r.second, DPR_OPPOSITE(r.step), raster));
  return change;
}

/// Adds the tangents of what the seconds' jumps have added. One work-item per DPR_ROWS of a tile. Deterministic.
/// Inputs as antialias_second_forward, and
/// in      cut_tangents     as antialias_cross_tangent leaves them
/// in      faded_tangents   float4[direction][pixel]
/// in out  tangents         float4[direction][pixel]
kernel void antialias_second_tangent(
    const FrameParams p, const uint directions, global const uint* restrict tile_starts,
    global const uint* restrict counts, global const SecondCrossing* restrict seconds,
    global const uint* restrict winner, global const float2* restrict cut,
    global const float4* restrict raster, global const float2* restrict cut_tangents,
    global const float4* restrict faded_tangents, global float4* restrict tangents) {
  const TileRows rows = tile_rows(p, (uint)get_global_id(0));
  if (rows.first >= rows.last || !may_be_crossed(p, rows.tile, tile_starts)) return;
  const Steps steps = {winner, cut, samples_of_window(p)};
  const NearTiles tiles = tiles_of_steps(p, rows.tile);
  for (uint i = 0; i < near_lists(tiles); ++i) {
    const uint list = near_list(p, tiles, i);
    for (uint k = 0; k < counts[list]; ++k) {
      const uint second = DPR_SECOND_ROOM * list + k;
      const SecondCrossing c = seconds[second];
      const uint2 samples = ends_of_step(p, c.step);
      const int has_first = is_in_rows(p, rows, samples.x), has_second = is_in_rows(p, rows, samples.y);
      if (!has_first && !has_second) continue;
      const Cut first = cut[c.step];
      const float2 parts = parts_gained(c, first);
      // By the second's own cut, and by that of the winner, at either end of the step.
      const Cut own[2] = {parts_by_cut(own_cut(c), -1.0f).first, parts_by_cut(own_cut(c), 1.0f).first},
                of_first[2] = {parts_by_cut(first, -1.0f).first, parts_by_cut(first, 1.0f).first};
      const float4 jump = jump_of(p, steps, c, raster);
      const Change change = change_of_jump(p, steps, c, directions, raster);
      for (uint d = 0; d < directions; ++d) {
        const size_t of = (size_t)d * steps.pixels;
        const Cut moved = cut_tangents[moved_second(p, directions, second) + d],
                  moved_first = cut_tangents[moved_step(directions, c.step) + d];
        float4 move = jump_of(p, steps, c, faded_tangents + of);
        if (change.is_there) move += cut_tangents[change.place + d].x * change.by_cut;
        if (has_first) {
          tangents[of + samples.x] +=
              parts.x * move + (dot(own[0], moved) - dot(of_first[0], moved_first)) * jump;
        }
        if (has_second) {
          tangents[of + samples.y] +=
              parts.y * move + (dot(of_first[1], moved_first) - dot(own[1], moved)) * jump;
        }
      }
    }
  }
}
