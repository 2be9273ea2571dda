// Work on the rows of tiles: one of them is a GPU's work-item's, all of a tile's a CPU's, whose lanes are a
// row's samples.
#ifndef DPR_TILE_ROWS_H
#define DPR_TILE_ROWS_H

#include "contour.h"

#ifndef DPR_LANES
#define DPR_LANES 8 /* the device's width; the host chooses it */
#endif

/// Rows of a work-item.
#if DPR_LANES == 1
#define DPR_ROWS 1
#else
#define DPR_ROWS DPR_TILE
#endif

/// Work-items of a tile.
#define DPR_TILE_ITEMS (DPR_TILE / DPR_ROWS)

/// Room of a work-item's list of crossings beside those that won their steps.
#define DPR_SECOND_ROOM (DPR_SECOND_CROSSINGS * DPR_ROWS / 2)

/// The rows of a tile that are a work-item's: [first, last) of its view.
typedef struct {
  uint tile, view;
  uint first_column, columns, first, last;
} TileRows;

/// None from p.last_tile on.
static inline TileRows tile_rows(const FrameParams p, uint item) {
  TileRows r;
  r.tile = item / DPR_TILE_ITEMS;
  r.view = r.tile / (p.tiles_x * p.tiles_y);
  const TileSamples s = tile_samples(p, r.tile);
  r.first_column = (uint)s.first_column;
  r.columns = (uint)(s.last_column - s.first_column);
  r.first = (uint)s.first_row + item % DPR_TILE_ITEMS * DPR_ROWS;
  r.last = r.tile < p.last_tile ? min(r.first + DPR_ROWS, (uint)s.last_row) : r.first;
  return r;
}

/// The list of a work-item that has a line of a tile: one of those of the window's tiles.
static inline uint list_of_line(const FrameParams p, uint tile, int line) {
  return (tile - p.first_tile) * DPR_TILE_ITEMS + (uint)(line % DPR_TILE) / DPR_ROWS;
}

/// The lines of a tile that are a work-item's, [first, last) of those of its tile: its rows where contours
/// cross rows, its columns where they cross columns. So each step is of one work-item.
typedef struct {
  uint tile;
  int first, last;
} TileLines;

static inline TileLines tile_lines(uint item) {
  const int first = (int)(item % DPR_TILE_ITEMS) * DPR_ROWS;
  const TileLines l = {item / DPR_TILE_ITEMS, first, first + DPR_ROWS};
  return l;
}

#endif
