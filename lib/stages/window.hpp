// Bands of samples: stretches of rows of tiles, of one view after the other, whose samples buffers hold at a time.
#pragma once

#include <algorithm>

#include "device/kernel.hpp"

namespace dpr {

/// Samples that are held: those of all views, but for a frame in bands of samples.
inline std::size_t pixels_of(const shared::FrameParams& p) {
  return std::size_t{p.views} * p.width * p.height - p.absent_samples;
}
/// Of all views.
inline std::size_t tiles_of(const shared::FrameParams& p) {
  return std::size_t{p.views} * p.tiles_x * p.tiles_y;
}
inline Range tile_rows_of(const shared::FrameParams& p) { return std::size_t{p.views} * p.tiles_y; }

/// The lines of samples, of all views, that lie before a row of tiles.
inline std::size_t lines_before(const shared::FrameParams& p, std::size_t row) {
  return row / p.tiles_y * p.height + row % p.tiles_y * DPR_TILE;
}
inline Range lines_of(const shared::FrameParams& p, const Range& rows) {
  const std::size_t first = lines_before(p, rows.first);
  return {first, lines_before(p, rows.first + rows.count) - first};
}

/// Rows of tiles, and so many around them, of the views that they are of.
inline Range with_rows_around(const shared::FrameParams& p, const Range& rows, std::size_t around) {
  const std::size_t last_row = rows.first + rows.count - 1, view_begin = rows.first / p.tiles_y * p.tiles_y,
                    view_end = (last_row / p.tiles_y + 1) * p.tiles_y;
  const std::size_t first = rows.first - std::min(around, rows.first - view_begin);
  return {first, std::min(last_row + 1 + around, view_end) - first};
}

/// Makes a stretch of rows of tiles the window of samples (kernels/window.h).
inline void set_window(shared::FrameParams& p, const Range& rows) {
  const Range lines = lines_of(p, rows);
  p.first_sample = static_cast<cl_uint>(lines.first * p.width);
  p.absent_samples = static_cast<cl_uint>((std::size_t{p.views} * p.height - lines.count) * p.width);
  p.first_tile = static_cast<cl_uint>(rows.first * p.tiles_x);
}
/// The rows of tiles of the window.
inline Range window_of(const shared::FrameParams& p) {
  const std::size_t first = p.first_tile / p.tiles_x;
  const std::size_t end = (p.first_sample + pixels_of(p)) / p.width, view = end / p.height;
  return {first, view * p.tiles_y + (end % p.height + DPR_TILE - 1) / DPR_TILE - first};
}

/// A launch of kernels that take so many work-items a tile, over rows of tiles.
struct TileLaunch {
  TileLaunch(const shared::FrameParams& of, const Range& rows, std::size_t items_of_tile)
      : p(of), items(rows.first * p.tiles_x * items_of_tile, rows.count * p.tiles_x * items_of_tile) {
    p.begin_tile = static_cast<cl_uint>(rows.first * p.tiles_x);
    p.last_tile = static_cast<cl_uint>((rows.first + rows.count) * p.tiles_x);
  }

  shared::FrameParams p;
  Range items;
};

}  // namespace dpr
