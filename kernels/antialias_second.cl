// Crossings that come second. Where contours meet, two of them cross one step between samples. Its winner
// (antialias_cross.cl) takes the whole jump from one sample to the other for its own, and what lies between
// the two has a colour that neither sample shows: without more, gradients lack about a sample's length at
// every corner. The second contour knows its own jump J from the nearest step along it that it has for
// itself, or a crease from samples that show its two faces: both samples get back what J has added to the
// winner's parts of them, and the second adds its own. So each jump counts where it is.
//
// Such steps are few: a tile's work-items list their own, and add those of the tiles around to their samples.
#include "second.h"

static inline int have_face_in_common(uint4 a, uint4 b) {
  const uint own = own_face(b);
  if (own_face(a) == own || (has_other_face(a) && other_face(a) == own)) return 1;
  if (!has_other_face(b)) return 0;
  const uint other = other_face(b);
  return own_face(a) == other || (has_other_face(a) && other_face(a) == other);
}

static inline int is_end_of(float2 place, float depth, const TileContour c) {
  return (all(place == c.a) && depth == c.depths.x) || (all(place == c.b) && depth == c.depths.y);
}

/// Edges meet where ends coincide. The cut of a face meets the face's edges, and lies on one plane with all
/// other cuts.
static inline int have_end_in_common(const TileContour a, const TileContour b) {
  const int a_is_cut = a.record.x == a.record.y, b_is_cut = b.record.x == b.record.y;
  if (a_is_cut != b_is_cut) return have_face_in_common(a.record, b.record);
  return a_is_cut || is_end_of(a.a, a.depths.x, b) || is_end_of(a.b, a.depths.y, b);
}

/// True if something hides a contour at a step that another has won. Of the two samples only the one on its
/// own side of the winner is asked: the other may show what the winner bounds.
static inline int is_second_hidden(const FrameParams p, const CrossingScene v, const TileContour winner,
                                   const TileContour c, const RasterEdge e, const Crossing x, float depth) {
  const RasterEdge of_winner = raster_edge(winner.a, winner.b, e.is_by_rows);
  const int is_first = x.position < position_on_line(p, of_winner, x.line),
            inner_first = first_is_inner(c, e);
  if (is_crease(c.flags)) {
    const int column = x.column + (e.is_by_rows && !is_first), row = x.row + (!e.is_by_rows && !is_first);
    const float front = v.front[v.first + (uint)row * p.width + (uint)column],
                slack = v.reach + DPR_DEPTH_SLACK * depth;
    return hides_crease(p, c, v.faces, v.ndc, inner_first == is_first, pixel_centre(p, column, row), front,
                        depth, slack);
  }
  if (inner_first != is_first && hidden_from(p, v, c, e, x, 0, depth)) return 1;
  // The surface that the winner bounds hides all behind it; contours that meet lie on one surface.
  return !is_crease(winner.flags) && is_first == first_is_inner(winner, of_winner) &&
         mix_depths(p, winner.depths, along_edge(p, of_winner, x.line)) <
             depth * (1.0f - DPR_DEPTH_SLACK) - v.reach &&
         !have_end_in_common(winner, c);
}

/// Lists the seconds of a tile, as many as there is room for. One work-item, with a list of its own, per
/// DPR_ROWS rows, and as many columns, of a tile. Deterministic. Inputs as antialias_cross has and leaves
/// them, and
/// out  counts   uint[list]
/// out  seconds  SecondCrossing[list][DPR_SECOND_ROOM]
kernel void antialias_second_find(const FrameParams p, global const ViewParams* restrict views,
                                  global const uint2* restrict edges, global const uint4* restrict faces,
                                  global const float4* restrict ndc,
                                  global const ClippedFace* restrict clipped,
                                  global const uint* restrict tile_starts,
                                  global const uint* restrict pair_contour,
                                  global const float* restrict front, global const uint* restrict front_face,
                                  global const uint* restrict winner, global const uchar* restrict crowded,
                                  global uint* restrict counts, global SecondCrossing* restrict seconds) {
  const uint item = (uint)get_global_id(0);
  const TileLines own = tile_lines(item);
  const uint tile = own.tile, view = tile / (p.tiles_x * p.tiles_y);
  if (tile >= p.last_tile) return;
  const uint list = item - p.first_tile * DPR_TILE_ITEMS;
  counts[list] = 0;
  if (tile_starts[tile + 1] - tile_starts[tile] < 2) return;
  const TileSamples s = tile_samples(p, tile);
  const CrossingScene v = {faces, ndc, front, place_of_sample(p, view, 0, 0),
                           p.depth_reach / views[view].inverse_range};
  uint count = 0;
  for (uint pair = tile_starts[tile]; pair < tile_starts[tile + 1] && count < DPR_SECOND_ROOM; ++pair) {
    const uint contour = pair_contour[pair];
    if (is_left_out(p, contour)) continue;
    const TileContour c = load_contour(p, contour, edges, faces, ndc, clipped);
    uint found = count;
#pragma unroll 1
    for (int by_rows = 0; by_rows < 2; ++by_rows) {
      const RasterEdge e = raster_edge(c.a, c.b, by_rows);
      const int2 lines = own_lines_of_edge(p, e, s, own);
      for (int line = lines.x; line < lines.y && found < DPR_SECOND_ROOM; ++line) {
        const Crossing x = cross_line(p, e, line);
        if (!is_step_of(p, e, x, s)) continue;
        const uint step = step_of(p, view, e, x), first = winner[step];
        if (!is_contour(first)) continue;
        if (first == contour) continue;
        const TileContour other = load_contour(p, first, edges, faces, ndc, clipped);
        if (is_second_hidden(p, v, other, c, e, x, mix_depths(p, c.depths, x.along))) continue;
        const Cut cut = cut_of(p, c, e, x);
        const SecondCrossing second = {step, contour, DPR_NO_CROSSING, cut.x, cut.y};
        seconds[DPR_SECOND_ROOM * list + found++] = second;
      }
    }
    // In a loop of its own, which loads the contour again: in those above, the search would need more registers
    // than 128.
    for (uint k = count; k < found; ++k) {
      SecondCrossing second = seconds[DPR_SECOND_ROOM * list + k];
      const TileContour again = load_contour(p, second.contour, edges, faces, ndc, clipped);
      const int by_rows = second.step < samples_of_window(p);
      const int2 at = sample_at(p, ends_of_step(p, second.step).x).at;
      const RasterEdge e = raster_edge(again.a, again.b, by_rows);
      const Crossing x = cross_line(p, e, by_rows ? at.y : at.x);
      second.reference = reference_of(p, view, second.contour, again, e, x, front_face, winner, crowded);
      if (second.reference != DPR_NO_CROSSING) seconds[DPR_SECOND_ROOM * list + count++] = second;
    }
  }
  counts[list] = count;
}

/// The gradient of a cut, with those of the parts that it takes of the jump at both samples.
static inline Cut gradient_by_parts(Cut cut, float of_first, float of_second) {
  return parts_taken_gradient(cut, -1.0f, (Parts)(of_first, 0.0f)) -
         parts_taken_gradient(cut, 1.0f, (Parts)(of_second, 0.0f));
}

/// Adds what a jump's gradient is to the sample at one end of its step, and to the one behind.
static inline void add_to_end(const FrameParams p, const Steps steps, const TileRows rows, Sample s, int step,
                              float way, float4 grad, global float4* grad_raster) {
  const float changes = continues(p, steps, s, step) ? way : 0.0f;
  if (is_in_rows(p, rows, s.index)) grad_raster[s.index] += (1.0f + changes) * grad;
  if (changes == 0.0f) return;
  const Sample behind = sample_beside(p, s, DPR_OPPOSITE(step));
  if (is_in_rows(p, rows, behind.index)) grad_raster[behind.index] -= changes * grad;
}

/// Puts the seconds' jumps where they are. One work-item per DPR_ROWS of a tile. Deterministic.
/// in      tile_starts      as antialias_cross has it: seconds are where contours are
/// in      counts, seconds  as antialias_second_find leaves them
/// in      winner, cut      as antialias_cross does
/// in      raster           float4[pixel]    the samples, as antialias_fade has faded them
/// in out  blended          float4[pixel]
kernel void antialias_second_forward(const FrameParams p, global const uint* restrict tile_starts,
                                     global const uint* restrict counts,
                                     global const SecondCrossing* restrict seconds,
                                     global const uint* restrict winner, global const float2* restrict cut,
                                     global const float4* restrict raster, global float4* restrict blended) {
  const TileRows rows = tile_rows(p, (uint)get_global_id(0));
  if (rows.first >= rows.last || !may_be_crossed(p, rows.tile, tile_starts)) return;
  const Steps steps = {winner, cut, samples_of_window(p)};
  const NearTiles tiles = tiles_of_steps(p, rows.tile);
  for (uint i = 0; i < near_lists(tiles); ++i) {
    const uint list = near_list(p, tiles, i);
    for (uint k = 0; k < counts[list]; ++k) {
      const SecondCrossing c = seconds[DPR_SECOND_ROOM * list + k];
      const uint2 samples = ends_of_step(p, c.step);
      const int has_first = is_in_rows(p, rows, samples.x), has_second = is_in_rows(p, rows, samples.y);
      if (!has_first && !has_second) continue;
      const float4 jump = jump_of(p, steps, c, raster);
      const float2 parts = parts_gained(c, cut[c.step]);
      if (has_first) blended[samples.x] += parts.x * jump;
      if (has_second) blended[samples.y] += parts.y * jump;
    }
  }
}

/// What the gradient of a second's jump is to the samples at its reference, and to the reference's cut.
static inline void add_to_reference(const FrameParams p, const Steps steps, const TileRows rows,
                                    const Reference r, float4 grad_jump, global const float4* restrict raster,
                                    global float2* grad_cut, global float4* grad_raster) {
  const int back = DPR_OPPOSITE(r.step);
  add_to_end(p, steps, rows, r.first, r.step, r.way_first, -grad_jump, grad_raster);
  add_to_end(p, steps, rows, r.second, back, r.way_second, grad_jump, grad_raster);
  if (!is_in_rows(p, rows, ends_of_step(p, r.place).x)) return;
  const float4 changes =
      change_towards(p, steps, r.first, r.step, raster) + change_towards(p, steps, r.second, back, raster);
  grad_cut[r.place].x += turn_of(r.step) * dot(grad_jump, changes);
}

/// The gradients of what winners and seconds cut, and of the samples at the references. One work-item per
/// DPR_ROWS of a tile. Deterministic. Inputs as antialias_second_forward, and
/// in      grad_blended  float4[pixel]
/// in out  grad_cut      Cut[2][pixel]
/// in out  grad_raster   float4[pixel]
/// out     grad_seconds  Cut[list][DPR_SECOND_ROOM]
kernel void antialias_second_backward(const FrameParams p, global const uint* restrict tile_starts,
                                      global const uint* restrict counts,
                                      global const SecondCrossing* restrict seconds,
                                      global const uint* restrict winner, global const float2* restrict cut,
                                      global const float4* restrict raster,
                                      global const float4* restrict grad_blended,
                                      global float2* restrict grad_cut, global float4* restrict grad_raster,
                                      global float2* restrict grad_seconds) {
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
      const int is_own = is_in_rows(p, rows, samples.x), is_by_step = c.reference >= DPR_SAMPLE_PAIRS;
      const uint2 of_jump =
          is_by_step ? ends_of_step(p, place_of_reference(c.reference)) : reference_samples(p, c);
      const int has_step = is_by_step && is_near_rows(p, rows, of_jump.x),
                has_before = !is_by_step && is_in_rows(p, rows, of_jump.x),
                has_behind = !is_by_step && is_in_rows(p, rows, of_jump.y);
      if (!is_own && !has_step && !has_before && !has_behind) continue;
      const float4 first = grad_blended[samples.x], second = grad_blended[samples.y];
      const float2 parts = parts_gained(c, cut[c.step]);
      const float4 grad_jump = parts.x * first + parts.y * second;
      if (has_step) {
        add_to_reference(p, steps, rows, load_reference(p, steps, c.reference), grad_jump, raster, grad_cut,
                         grad_raster);
      }
      if (has_behind) grad_raster[of_jump.y] += grad_jump;
      if (has_before) grad_raster[of_jump.x] -= grad_jump;
      if (!is_own) continue;
      const float4 jump = jump_of(p, steps, c, raster);
      const float of_first = dot(first, jump), of_second = dot(second, jump);
      grad_cut[c.step] -= gradient_by_parts(cut[c.step], of_first, of_second);
      grad_seconds[place] = gradient_by_parts(own_cut(c), of_first, of_second);
    }
  }
}
