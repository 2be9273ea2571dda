// Bands of a frame: stretches of tiles whose fragments fit the memory budget.
#include <algorithm>
#include <utility>

#include "stages/rasterize.hpp"

namespace dpr {

namespace {

/// The pixels of a stretch of the window's tiles: of whole rows, or of a part of one.
PixelBlock pixel_block(const shared::FrameParams& p, const Range& tiles) {
  const auto first_pixel = [&](std::size_t row) { return lines_before(p, row) * p.width - p.first_sample; };
  const std::size_t row = tiles.first / p.tiles_x, column = tiles.first % p.tiles_x * DPR_TILE;
  if (tiles.count % p.tiles_x == 0) {
    return {first_pixel(row), first_pixel(row + tiles.count / p.tiles_x) - first_pixel(row)};
  }
  return {first_pixel(row) + column, std::min<std::size_t>(tiles.count * DPR_TILE, p.width - column),
          std::min<std::size_t>(DPR_TILE, p.height - row % p.tiles_y * DPR_TILE), p.width};
}

std::size_t bytes_of_band(std::size_t fragments, std::size_t bytes_each) {
  return with_headroom(fragments + k_widest_vector) * bytes_each;
}

template <class Start>
Band make_band(const shared::FrameParams& p, const Start& first, const Start& last) {
  const auto between = [](std::size_t begin, std::size_t end) { return Range(begin, end - begin); };
  const Range tiles = between(first.tile, last.tile);
  return {tiles, between(first.pair, last.pair), pixel_block(p, tiles),
          between(first.fragment, last.fragment)};
}

}  // namespace

void Rasterize::read_rows(const shared::FrameParams& p) {
  row_starts_.clear();
  for (const cl_uint4& row : device_rows_.download()) {
    row_starts_.push_back({row_starts_.size() * p.tiles_x, row.s[0], row.s[1]});
  }
}

std::vector<Rasterize::TileStart> Rasterize::tile_starts(const shared::FrameParams& p, const Bin& bin,
                                                         std::size_t row) const {
  const TileStart &begin = row_starts_[row], &end = row_starts_[row + 1];
  std::vector<cl_uint> first_pairs(p.tiles_x), first_fragments(end.pair - begin.pair + 1);
  bin.tile_starts.download(first_pairs, begin.tile);
  (in_bands_ ? frame_fragment_starts_ : fragment_starts).download(first_fragments, begin.pair);
  std::vector<TileStart> starts;
  for (std::size_t x = 0; x < first_pairs.size(); ++x) {
    starts.push_back({begin.tile + x, first_pairs[x], first_fragments[first_pairs[x] - begin.pair]});
  }
  return starts;
}

std::vector<Band> Rasterize::cut(const shared::FrameParams& p, const Bin& bin, const Range& rows,
                                 std::size_t budget, std::size_t fragment_bytes) const {
  const auto bytes_of = [&](std::size_t number) { return bytes_of_band(number, fragment_bytes); };
  std::vector<TileStart> cuts;
  for (std::size_t row = rows.first; row < rows.last(); ++row) {
    const bool fits = bytes_of(row_starts_[row + 1].fragment - row_starts_[row].fragment) <= budget;
    const std::vector<TileStart> tiles = fits ? std::vector{row_starts_[row]} : tile_starts(p, bin, row);
    cuts.insert(cuts.end(), tiles.begin(), tiles.end());
  }
  cuts.push_back(row_starts_[rows.last()]);
  const auto count = [&](std::size_t first, std::size_t last) {
    return cuts[last].fragment - cuts[first].fragment;
  };
  std::size_t largest = 0;
  for (std::size_t i = 0; i + 1 < cuts.size(); ++i) largest = std::max(largest, count(i, i + 1));
  const auto row_of = [&](std::size_t i) { return cuts[i].tile / p.tiles_x; };
  const auto is_row = [&](std::size_t i) { return cuts[i + 1].tile - cuts[i].tile == p.tiles_x; };
  const auto may_join = [&](std::size_t first, std::size_t next) {
    return is_row(first) ? is_row(next) : row_of(first) == row_of(next);
  };
  // The bands have equal size rather than the largest; none is larger than the first, so that buffers do
  // not grow.
  const std::size_t total = count(0, cuts.size() - 1), least_bands = bytes_of(total) / budget + 1;
  std::size_t most = least_bands == 1 ? total : std::max(total / least_bands, largest);
  std::vector<Band> bands;
  for (std::size_t first = 0, last = 0; last + 1 < cuts.size(); first = last) {
    last = first + 1;
    while (last + 1 < cuts.size() && may_join(first, last) && count(first, last + 1) <= most) ++last;
    bands.push_back(make_band(p, cuts[first], cuts[last]));
    most = std::max(bands.front().fragments.count, largest);
  }
  return bands;
}

void Rasterize::require_fits(std::span<const Band> bands, std::size_t budget, std::size_t fragment_bytes) {
  std::size_t largest = 0;
  for (const Band& band : bands) largest = std::max(largest, band.fragments.count);
  const std::size_t bytes = bytes_of_band(largest, fragment_bytes);
  if (bytes <= budget) return;
  throw InvalidArgument("memory budget (frame)", std::to_string(budget) + " bytes",
                        "at least " + std::to_string(bytes) + " for the fragments of one tile of 8x8 pixels");
}

std::vector<Range> Rasterize::pixels(const shared::FrameParams& p) const {
  if (!band) return {pixels_of(p)};
  std::vector<Range> rows;
  for (std::size_t row = 0; row < band->pixels.rows; ++row) rows.push_back(band->pixels.row(row));
  return rows;
}

Range Rasterize::tiles(const shared::FrameParams& p) const { return band ? band->tiles : Range(tiles_of(p)); }

/// The runs of a band, counted from its first element.
void Rasterize::rebase(const Band& next) {
  if (!in_bands_) {
    std::swap(fragment_starts, frame_fragment_starts_);
    std::swap(pixel_starts, frame_pixel_starts_);
    in_bands_ = true;
  }
  const auto rebase = [&](const PixelBlock& runs, const Buffer<cl_uint>& frame_starts,
                          Buffer<cl_uint>& starts) {
    starts.resize(device_, frame_starts.size());
    launch_(runs.rows * (runs.columns + 1),
            kernel::rasterize_rebase{.first = static_cast<cl_uint>(runs.first),
                                     .columns = static_cast<cl_uint>(runs.columns),
                                     .rows = static_cast<cl_uint>(runs.rows),
                                     .stride = static_cast<cl_uint>(runs.stride),
                                     .starts = frame_starts,
                                     .band_starts = starts});
  };
  rebase({next.pairs.first, next.pairs.count}, frame_fragment_starts_, fragment_starts);
  rebase(next.pixels, frame_pixel_starts_, pixel_starts);
}

}  // namespace dpr
