// Crossings that come second (antialias_second.cl): their lists near a tile, and their jumps.
#ifndef DPR_SECOND_H
#define DPR_SECOND_H

#include "second_reference.h"

/// The sample that a reference counts, from the first within reach of its step.
static inline uint within_reach(const FrameParams p, uint first_of_step, uint k) {
  return first_of_step + k % DPR_FACE_SPAN + k / DPR_FACE_SPAN * p.width - DPR_FACE_REACH * (p.width + 1);
}

/// The samples of a reference to two: before the contour, and behind it.
static inline uint2 reference_samples(const FrameParams p, const SecondCrossing c) {
  const uint first = ends_of_step(p, c.step).x, pairs = DPR_FACE_SPAN * DPR_FACE_SPAN;
  return (uint2)(within_reach(p, first, c.reference % pairs), within_reach(p, first, c.reference / pairs));
}

/// True if a place is that of one of the rows' samples. What lies to the left of them counts as the end of the line
/// above, and is none.
static inline int is_in_rows(const FrameParams p, const TileRows rows, uint sample) {
  const uint from_first = sample - place_of_sample(p, rows.view, rows.first_column, rows.first);
  return from_first < (rows.last - rows.first) * p.width && from_first % p.width < rows.columns;
}

/// False only if a place is more than two samples away from the rows, along lines or across.
static inline int is_near_rows(const FrameParams p, const TileRows rows, uint sample) {
  const uint from_first =
      sample - place_of_sample(p, rows.view, rows.first_column, rows.first) + 2 * (p.width + 1);
  return from_first < (rows.last - rows.first + 5) * p.width && from_first % p.width < rows.columns + 4;
}

/// The tiles from whose steps a sample of one is reached: itself, those to the left and above.
static inline NearTiles tiles_of_steps(const FrameParams p, uint tile) {
  const uint in_view = tile % (p.tiles_x * p.tiles_y), left = in_view % p.tiles_x > 0 ? 1 : 0,
             above = in_view >= p.tiles_x ? 1 : 0;
  const NearTiles tiles = {tile - left - above * p.tiles_x, 1 + left, 1 + above};
  return tiles;
}

/// The lists of the tiles near one, in a fixed order.
static inline uint near_list(const FrameParams p, const NearTiles tiles, uint k) {
  const uint in_tiles = k / DPR_TILE_ITEMS;
  const uint tile = tiles.first + in_tiles / tiles.columns * p.tiles_x + in_tiles % tiles.columns;
  return (tile - p.first_tile) * DPR_TILE_ITEMS + k % DPR_TILE_ITEMS;
}

static inline uint near_lists(const NearTiles tiles) { return tiles.columns * tiles.rows * DPR_TILE_ITEMS; }

static inline Cut own_cut(const SecondCrossing c) { return (Cut)(c.cut, c.slope2); }

/// The parts of a second's jump that the two samples of its step gain: its own, less the winner's.
static inline float2 parts_gained(const SecondCrossing c, Cut winner) {
  return (float2)(parts_taken(own_cut(c), -1.0f).x - parts_taken(winner, -1.0f).x,
                  parts_taken(winner, 1.0f).x - parts_taken(own_cut(c), 1.0f).x);
}

/// The step at which a second's jump is taken, from the sample on the side of the second's first to the
/// other; and the way to the contour from each.
typedef struct {
  uint place;
  Sample first, second;
  int step;  // from the first sample
  float way_first, way_second;
} Reference;

/// Of a reference to a step.
static inline uint place_of_reference(uint reference) { return (reference - DPR_SAMPLE_PAIRS) & ~DPR_TURNED; }

static inline Reference load_reference(const FrameParams p, const Steps steps, uint reference) {
  Reference r;
  const uint turned_step = reference - DPR_SAMPLE_PAIRS;
  r.place = place_of_reference(reference);
  const uint2 ends = ends_of_step(p, r.place);
  const float t = 0.5f + steps.cut[r.place].x;
  const int is_turned = (turned_step & DPR_TURNED) != 0, ahead = r.place < steps.pixels ? 0 : 1;
  r.step = is_turned ? DPR_OPPOSITE(ahead) : ahead;
  r.first = sample_at(p, is_turned ? ends.y : ends.x);
  r.second = sample_beside(p, r.first, r.step);
  r.way_first = is_turned ? 1.0f - t : t;
  r.way_second = 1.0f - r.way_first;
  return r;
}

/// The jump across a contour, of the colours on both sides as they continue to it.
static inline float4 jump_at(const FrameParams p, const Steps steps, const Reference r,
                             global const float4* restrict raster) {
  return raster[r.second.index] +
         r.way_second * change_towards(p, steps, r.second, DPR_OPPOSITE(r.step), raster) -
         raster[r.first.index] - r.way_first * change_towards(p, steps, r.first, r.step, raster);
}

static inline float4 jump_of(const FrameParams p, const Steps steps, const SecondCrossing c,
                             global const float4* restrict raster) {
  if (c.reference >= DPR_SAMPLE_PAIRS)
    return jump_at(p, steps, load_reference(p, steps, c.reference), raster);
  const uint2 samples = reference_samples(p, c);
  return raster[samples.y] - raster[samples.x];
}

#endif
