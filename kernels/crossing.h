// Crossings of contours with the lines of samples: where a mesh edge passes between two neighbouring samples,
// and what each of these takes of the other's colour.
//
// Samples stand for what lies around them by a tent, 1 at the sample and 0 at its neighbours: so the blur
// sees a contour where it is, by the line between its weights at the two samples, and not at one of them. A
// jump at the fraction t of the step gives the first sample (1 - t)^2 / 2 of the second's colour, and the
// second t^2 / 2 of the first's. The difference, 1/2 - t, is the area between the edge and the border of the
// cells.
//
// An edge takes the area between it and the staircase of the rigid samples' cells. A line adds the
// piece of that area in its row or column of cells, by the edge's place on the line. An edge's ends lie
// between lines: there the area is closed by the straight way from the end to the corner of the four cells
// around it, where the staircases of all edges that meet in the end meet too. So the pieces of edges that
// meet add up, whatever their colours, and an end's gradient is that of the area: along the edge too.
#ifndef DPR_CROSSING_H
#define DPR_CROSSING_H

#include "tile_rows.h"

/// An edge on the raster, as the rows cross it or the columns.
typedef struct {
  float2 a, b;  // NDC
  int is_by_rows;
  int ascends;    // b is above a by rows, to the right of a by columns
  float inverse;  // of the edge's extent across the lines
  float slope;    // of its other coordinate by that across the lines
} RasterEdge;

static inline RasterEdge raster_edge(float2 a, float2 b, int is_by_rows) {
  RasterEdge e;
  e.a = a;
  e.b = b;
  e.is_by_rows = is_by_rows;
  const float dx = b.x - a.x, dy = b.y - a.y, across = is_by_rows ? dy : dx;
  e.ascends = across > 0.0f;
  e.inverse = across != 0.0f ? 1.0f / across : 0.0f;
  e.slope = (is_by_rows ? dx : dy) * e.inverse;
  return e;
}

/// Squared sine of an edge's angle to the lines below which the lines across alone count it, and the width
/// of the range in which both do: slopes of 1/2 to 2.
#define DPR_FLATTEST 0.2f
#define DPR_RANGE_OF_BOTH 0.6f

/// Edges of a larger squared slope do not count.
#define DPR_SLOPE2_THAT_COUNTS 4.0f

static inline float range_of_slope(float slope2) {
  return clamp((1.0f / (1.0f + slope2) - DPR_FLATTEST) / DPR_RANGE_OF_BOTH, 0.0f, 1.0f);
}

/// Weight of an edge by lines to whose normal it has a slope; by those across it counts the rest. A
/// step function of the slope would leave out, or count twice, up to half a cell where a smooth contour
/// passes 45 degrees.
static inline float weight_of_slope(float slope2) {
  const float x = range_of_slope(slope2);
  return x * x * (3.0f - 2.0f * x);
}

/// Its derivative by the squared slope.
static inline float weight_of_slope_gradient(float slope2) {
  const float x = range_of_slope(slope2), sine2 = 1.0f / (1.0f + slope2);
  return -6.0f * x * (1.0f - x) / DPR_RANGE_OF_BOTH * sine2 * sine2;
}

/// A crossing of an edge with a line of samples, a row or a column.
typedef struct {
  int exists;  // 0: nothing else is set
  int line;
  int column, row;  // of the step's first sample
  float position;   // on the line, in samples
  float t;          // from the step's first sample to the next, in [0, 1]
  float along;      // along_edge()
} Crossing;

/// True if a sample lies behind the edge: to the right of it, or below. One on the edge does if the triangles
/// agree: see is_owned_at().
static inline int is_behind(const RasterEdge e, float2 sample) {
  int side = side_of_line(e.a, e.b, sample);
  if (side == 0) side = e.b.y < e.a.y || (e.b.y == e.a.y && e.b.x < e.a.x) ? 1 : -1;
  return (side < 0) == e.ascends;
}

/// True if a point does not lie behind a line. One on the line belongs to its upper or right side, so that a
/// chain of edges crosses it once.
static inline int is_before_line(const FrameParams p, int is_by_rows, float2 point, int line) {
  const float2 at = pixel_centre(p, line, line);
  return is_by_rows ? point.y >= at.y : point.x <= at.x;
}

/// True if an edge between two points crosses a line.
static inline int crosses_line(const FrameParams p, float2 a, float2 b, int is_by_rows, int line) {
  return is_before_line(p, is_by_rows, a, line) != is_before_line(p, is_by_rows, b, line);
}

/// Position at which the edge's line crosses a line of samples, in samples along it.
static inline float position_on_line(const FrameParams p, const RasterEdge e, int line) {
  const float2 at = pixel_centre(p, line, line);
  return e.is_by_rows ? column_at(p, e.a.x + (at.y - e.a.y) * e.slope)
                      : row_at(p, e.a.y + (at.x - e.a.x) * e.slope);
}

/// Position of that crossing on the edge, from its first end to its second, in [0, 1].
static inline float along_edge(const FrameParams p, const RasterEdge e, int line) {
  const float2 from_first = pixel_centre(p, line, line) - e.a;
  // Not by ?:, of which a component with an index that varies would be made.
  return clamp(select(from_first.x, from_first.y, e.is_by_rows) * e.inverse, 0.0f, 1.0f);
}

/// Crossing of an edge and a line. The step's samples lie on different sides of the edge, as the
/// triangles have them.
static inline Crossing cross_line(const FrameParams p, const RasterEdge e, int line) {
  Crossing c = {0, 0, 0, 0, 0.0f, 0.0f, 0.0f};
  if (!crosses_line(p, e.a, e.b, e.is_by_rows, line)) return c;
  c.exists = 1;
  c.line = line;
  c.position = position_on_line(p, e, line);
  c.along = along_edge(p, e, line);
  const float size = (float)(e.is_by_rows ? p.width : p.height);
  const int nearest = (int)floor(clamp(c.position, -2.0f, size));
  // The first sample behind the edge, of those around the position, ends the step.
  int sample = nearest;
#pragma unroll 1
  while (sample < nearest + 2 &&
         !is_behind(e, e.is_by_rows ? pixel_centre(p, sample, line) : pixel_centre(p, line, sample))) {
    ++sample;
  }
  const int first = sample - 1;
  c.column = e.is_by_rows ? first : line;
  c.row = e.is_by_rows ? line : first;
  c.t = clamp(c.position - (float)first, 0.0f, 1.0f);
  return c;
}

/// Area that an edge's end adds to the outermost crossing on its side: half of the way across lines from the
/// corner of the four cells to the end, times the way along them from the corner to the edge.
typedef struct {
  float area;
  float along;   // where the edge's line is at the corner's height, from the first end to the second
  float height;  // d area / d position of the edge at that height
  float width;   // d area / d the end's way across the lines
} CornerArea;

/// 0 where the edge goes on to the next line on that side.
static inline CornerArea corner_area(const FrameParams p, const RasterEdge e, const Crossing x, float2 end) {
  const int is_before = is_before_line(p, e.is_by_rows, end, x.line), towards_end = is_before ? -1 : 1;
  CornerArea c = {0.0f, 0.0f, 0.0f, 0.0f};
  if (is_before_line(p, e.is_by_rows, end, x.line + towards_end) == is_before) return c;
  const float column = column_at(p, end.x), row = row_at(p, end.y);
  const float across = e.is_by_rows ? row : column, position = e.is_by_rows ? column : row;
  const float half_step = 0.5f * (float)towards_end, lines = e.is_by_rows ? -p.pixel_size : p.pixel_size;
  c.along = x.along + half_step * lines * e.inverse;
  c.height = half_step * (across - (float)x.line - half_step);
  const float length = x.position - half_step * e.slope - floor(position) - 0.5f;
  c.width = half_step * length;
  c.area = c.height * length;
  return c;
}

/// Cut of a crossing: x is the area between the edge and the cells' border, negative where it is the first
/// sample's cell that is cut, in [-1/2, 1/2] but for what the edge's ends add; y the edge's squared slope to
/// the lines' normal.
typedef float2 Cut;

/// The lines [x, y) of a tile that an edge may cross.
static inline int2 lines_of_edge(const FrameParams p, const RasterEdge e, const TileSamples s) {
  const float2 a = to_samples(p, e.a), b = to_samples(p, e.b);
  const float low = e.is_by_rows ? fmin(a.y, b.y) : fmin(a.x, b.x);
  const float high = e.is_by_rows ? fmax(a.y, b.y) : fmax(a.x, b.x);
  const float first = (float)(e.is_by_rows ? s.first_row : s.first_column);
  const float last = (float)(e.is_by_rows ? s.last_row : s.last_column);
  return (int2)((int)clamp(floor(low), first, last), (int)clamp(ceil(high) + 1.0f, first, last));
}

/// Those of them that are a work-item's.
static inline int2 own_lines_of_edge(const FrameParams p, const RasterEdge e, const TileSamples s,
                                     const TileLines own) {
  const int first = e.is_by_rows ? s.first_row : s.first_column;
  const int2 lines = lines_of_edge(p, e, s);
  return (int2)(max(lines.x, first + own.first), min(lines.y, first + own.last));
}

/// Whether the tile owns the crossing's step, and the step has a second sample.
static inline int is_step_of(const FrameParams p, const RasterEdge e, const Crossing c, const TileSamples s) {
  return c.exists && c.column >= s.first_column && c.column < s.last_column && c.row >= s.first_row &&
         c.row < s.last_row && (e.is_by_rows ? c.column + 1 < (int)p.width : c.row + 1 < (int)p.height);
}

#endif
