// The reference of a contour that comes second (antialias_second.cl), which shows the jump across it: the
// nearest step along it that it has for itself, or samples of a crease's two faces.
#ifndef DPR_SECOND_REFERENCE_H
#define DPR_SECOND_REFERENCE_H

#include "visibility.h"

/// Most lines between a contour and a step of its own. Crossings are at most twice as far along the
/// lines, and the samples behind the step one more: all of it lies at most DPR_NEAR_TILES away.
#define DPR_REFERENCE_LINES 6
#define DPR_NEAR_TILES 2

/// From so many lines away on, samples that show a crease's faces go before a step.
#define DPR_NEAR_LINES 3

/// Set in a reference whose samples lie the other way round.
#define DPR_TURNED 0x80000000u

static inline int lies_on_raster(const FrameParams p, const RasterEdge e, const Crossing x) {
  return x.column >= 0 && x.row >= 0 && x.column + e.is_by_rows < (int)p.width &&
         x.row + !e.is_by_rows < (int)p.height;
}

/// The samples at both ends of a step.
static inline uint2 ends_of_step(const FrameParams p, uint step) {
  const uint pixels = samples_of_window(p);
  return step < pixels ? (uint2)(step, step + 1) : (uint2)(step - pixels, step - pixels + p.width);
}

static inline uint tile_of_sample(const FrameParams p, uint view, uint column, uint row) {
  return (view * p.tiles_y + row / DPR_TILE) * p.tiles_x + column / DPR_TILE;
}

/// The step of a crossing, if the contour crosses it alone. With DPR_TURNED where its first sample lies on
/// the other side of the contour.
static inline uint own_step(const FrameParams p, uint view, uint contour, const TileContour c, int by_rows,
                            int line, int first_is_within, global const uint* restrict winner,
                            global const uchar* restrict crowded) {
  if (!crosses_line(p, c.a, c.b, by_rows, line)) return DPR_NO_CROSSING;
  const RasterEdge e = raster_edge(c.a, c.b, by_rows);
  const Crossing x = cross_line(p, e, line);
  if (!lies_on_raster(p, e, x)) return DPR_NO_CROSSING;
  const uint step = step_of(p, view, e, x);
  const uint tile = tile_of_sample(p, view, (uint)x.column, (uint)x.row);
  if (winner[step] != contour || has_bit(crowded + DPR_TILE_BYTES * (tile - p.first_tile), e, x))
    return DPR_NO_CROSSING;
  return first_is_inner(c, e) == first_is_within ? step : step | DPR_TURNED;
}

/// How many samples away from a step one that shows a face is looked for, and how many that are along a line.
#define DPR_FACE_REACH 3
#define DPR_FACE_SPAN (2 * DPR_FACE_REACH + 2)

/// References below it are two samples, each counted by its column, then its row, from the first within reach
/// of the step; from it on they are steps.
#define DPR_SAMPLE_PAIRS (DPR_FACE_SPAN * DPR_FACE_SPAN * DPR_FACE_SPAN * DPR_FACE_SPAN)

/// True if one of a row's faces is one of two.
static inline int has_either(uint8 faces, uint a, uint b) { return any(faces == a || faces == b); }

/// The samples nearest to a crossing that show the faces before and behind it, as a reference;
/// DPR_NO_CROSSING if none shows one of them.
static inline uint find_samples(const FrameParams p, uint view, uint before, uint behind, const RasterEdge e,
                                const Crossing x, global const uint* restrict front_face) {
  const float2 at = e.is_by_rows ? (float2)(x.position, (float)x.line) : (float2)((float)x.line, x.position);
  const int first_column = x.column - DPR_FACE_REACH, first_row = x.row - DPR_FACE_REACH;
  const int columns_begin = max(first_column, 0),
            columns_end = min(first_column + DPR_FACE_SPAN, (int)p.width);
  float least_before = INFINITY, least_behind = INFINITY;
  uint found_before = 0, found_behind = 0;
  for (int row = max(first_row, 0); row < min(first_row + DPR_FACE_SPAN, (int)p.height); ++row) {
    global const uint* const shown = front_face + place_of_sample(p, view, (uint)columns_begin, (uint)row);
    if (columns_end - columns_begin == DPR_FACE_SPAN && !has_either(vload8(0, shown), before, behind))
      continue;
#pragma unroll 1
    for (int column = columns_begin; column < columns_end; ++column) {
      const uint face = shown[column - columns_begin];
      const float2 away = (float2)((float)column, (float)row) - at;
      const float distance2 = dot(away, away);
      const uint k = (uint)(column - first_column + DPR_FACE_SPAN * (row - first_row));
      if (face == before && distance2 < least_before) {
        least_before = distance2;
        found_before = k;
      } else if (face == behind && distance2 < least_behind) {
        least_behind = distance2;
        found_behind = k;
      }
    }
  }
  return fmax(least_before, least_behind) < INFINITY
             ? found_before + DPR_FACE_SPAN * DPR_FACE_SPAN * found_behind
             : DPR_NO_CROSSING;
}

/// What shows the jump across a contour; DPR_NO_CROSSING if nothing does. The colours of a step of its own,
/// the nearest on the lines of the crossing or on those across, continue to it.
static inline uint reference_of(const FrameParams p, uint view, uint contour, const TileContour c,
                                const RasterEdge e, const Crossing x, global const uint* restrict front_face,
                                global const uint* restrict winner, global const uchar* restrict crowded) {
  const int is_inner = first_is_inner(c, e), across = e.is_by_rows ? x.column : x.row;
#pragma unroll 1
  for (int away = 1; away <= DPR_REFERENCE_LINES; ++away) {
    if (away == DPR_NEAR_LINES && is_crease(c.flags)) {
      const uint own = view * p.faces + own_face(c.record), other = view * p.faces + other_face(c.record);
      const uint samples =
          find_samples(p, view, is_inner ? own : other, is_inner ? other : own, e, x, front_face);
      if (samples != DPR_NO_CROSSING) return samples;
    }
#pragma unroll 1
    for (int turn = 0; turn < 4; ++turn) {
      const int is_across = turn % 2, from = is_across ? across : x.line;
      const int line = turn / 2 ? from + away : from - away + is_across;
      const uint step = own_step(p, view, contour, c, is_across ? !e.is_by_rows : e.is_by_rows, line,
                                 is_inner, winner, crowded);
      if (step != DPR_NO_CROSSING) return step + DPR_SAMPLE_PAIRS;
    }
  }
  return DPR_NO_CROSSING;
}

#endif
