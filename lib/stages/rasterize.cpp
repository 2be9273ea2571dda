#include "stages/rasterize.hpp"

#include <utility>

namespace dpr {

Rasterize::Rasterize(Device::Impl& device)
    : device_(device),
      cover_(device, "rasterize.cl", "rasterize_cover"),
      count_(device, "rasterize.cl", "rasterize_count"),
      rows_(device, "rasterize.cl", "rasterize_rows"),
      fit_(device, "rasterize.cl", "rasterize_fit"),
      rebase_(device, "rasterize.cl", "rasterize_rebase"),
      list_(device, "rasterize.cl", "rasterize_list"),
      forward_(device, "rasterize.cl", "rasterize_forward"),
      backward_(device, "rasterize.cl", "rasterize_backward"),
      scan_(device) {}

namespace {

/// Work-items of the listing kernels for a tile: vectors of pixels.
std::size_t vectors_of_tile(const Device::Impl& device) {
  return std::size_t{DPR_TILE} * DPR_TILE / std::min<std::size_t>(device.info.lanes, DPR_TILE);
}

std::size_t pixels_of(const shared::FrameParams& p) { return std::size_t{p.views} * p.width * p.height; }
std::size_t tiles_of(const shared::FrameParams& p) { return std::size_t{p.views} * p.tiles_x * p.tiles_y; }

Band whole_frame(const shared::FrameParams& p, const FrameCounts& counts) {
  return {tiles_of(p), counts.pairs, pixels_of(p), counts.fragments, counts.listed};
}

}  // namespace

void Rasterize::count(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles,
                      const Bin& bin) {
  const auto pairs = static_cast<cl_uint>(bin.pairs);
  const std::size_t pixels = pixels_of(p);
  masks.resize(device_, length(pairs));
  counts_.resize(device_, std::max<std::size_t>(pairs, pixels));
  cover_(pairs, p, pairs, bin.pair_count, triangles, bin.pair_face, bin.pair_tile, masks, counts_);
  scan_(length(pairs), counts_, fragment_starts);
  count_(tiles_of(p) * vectors_of_tile(device_), p, bin.tile_starts, masks, counts_);
  scan_(pixels, counts_, pixel_starts);

  const std::size_t rows = std::size_t{p.views} * p.tiles_y;
  device_rows_.resize(device_, rows + 1);
  rows_(rows + 1, p, bin.tile_starts, bin.pair_starts, fragment_starts, pixel_starts, device_rows_);
  in_bands_ = false;
}

void Rasterize::cover(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles,
                      const Bin& bin) {
  counted_ = true;
  count(p, triangles, bin);
  row_starts_.clear();
  for (const cl_uint4& row : device_rows_.download()) row_starts_.push_back({row.s[0], row.s[1], row.s[2]});
  check_total(row_starts_.back().fragment, "fragments (frame)");
  listed_fragments = row_starts_.back().listed;
}

FrameCounts Rasterize::counted() const {
  return {row_starts_.back().pair, row_starts_.back().fragment, row_starts_.back().listed};
}

Band Rasterize::make_band(const shared::FrameParams& p, std::size_t first_row, std::size_t last_row) const {
  const auto first_pixel = [&](std::size_t row) {
    return (row / p.tiles_y * p.height + row % p.tiles_y * DPR_TILE) * p.width;
  };
  const auto between = [](std::size_t first, std::size_t last) { return Range(first, last - first); };
  const RowStart &first = row_starts_[first_row], &last = row_starts_[last_row];
  return {between(first_row * p.tiles_x, last_row * p.tiles_x), between(first.pair, last.pair),
          between(first_pixel(first_row), first_pixel(last_row)), between(first.fragment, last.fragment),
          between(first.listed, last.listed)};
}

std::vector<Band> Rasterize::cut(const shared::FrameParams& p, std::size_t budget,
                                 std::size_t fragment_bytes) const {
  const std::size_t rows = row_starts_.size() - 1, total = row_starts_.back().fragment;
  const auto count = [&](std::size_t first, std::size_t last) {
    return row_starts_[last].fragment - row_starts_[first].fragment;
  };
  std::size_t largest_row = 0;
  for (std::size_t row = 0; row < rows; ++row) largest_row = std::max(largest_row, count(row, row + 1));
  if (with_headroom(largest_row) * fragment_bytes > budget) {
    throw InvalidArgument("memory budget (frame)", std::to_string(budget) + " bytes",
                          "at least " + std::to_string(with_headroom(largest_row) * fragment_bytes) +
                              " for the fragments of one row of tiles");
  }
  // Of equal size rather than as large as may be; and none larger than the first, so that buffers do not
  // grow.
  const std::size_t least_bands = with_headroom(total) * fragment_bytes / budget + 1;
  std::size_t most = least_bands == 1 ? total : std::max(total / least_bands, largest_row);
  std::vector<Band> bands;
  for (std::size_t first = 0, last = 0; first < rows; first = last) {
    last = first + 1;
    while (last < rows && count(first, last + 1) <= most) ++last;
    bands.push_back(make_band(p, first, last));
    most = std::max(bands.front().fragments.count, largest_row);
  }
  return bands;
}

/// The runs of a band, counted from its first element. Work-groups reach beyond its last pixel: there the
/// runs must be empty.
void Rasterize::rebase(const Band& next) {
  if (!in_bands_) {
    std::swap(fragment_starts, frame_fragment_starts_);
    std::swap(pixel_starts, frame_pixel_starts_);
    in_bands_ = true;
  }
  const auto rebase = [&](const Range& runs, const Range& elements, const Buffer<cl_uint>& frame_starts,
                          Buffer<cl_uint>& starts) {
    starts.resize(device_, frame_starts.size());
    rebase_(Range(runs.first, runs.count + 1 + device_.local_size()),
            static_cast<cl_uint>(frame_starts.size()), static_cast<cl_uint>(elements.first), elements.last(),
            frame_starts, starts);
  };
  rebase(next.pairs, next.fragments, frame_fragment_starts_, fragment_starts);
  rebase(next.pixels, next.listed, frame_pixel_starts_, pixel_starts);
}

void Rasterize::forward(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles,
                        const Bin& bin, const Band& next) {
  if (next.tiles.count < tiles_of(p)) rebase(next);
  band = next;
  fragments = next.fragments.count;
  list.resize(device_, length(next.listed.count));
  for (Buffer<cl_uint>* buffer : {&fragment_pair, &fragment_pixel})
    buffer->resize(device_, fragment_length());
  for (Buffer<float>* buffer : {&distance, &depth, &bary1, &bary2})
    buffer->resize(device_, fragment_length());
  const std::size_t vectors = vectors_of_tile(device_);
  const Range listing(next.tiles.first * vectors, next.tiles.count * vectors);
  list_(listing, p, listing.last(), bin.tile_starts, masks, fragment_starts, pixel_starts, list);
  forward_(next.pairs, p, next.pairs.last(), triangles, bin.pair_face, bin.pair_tile, masks, fragment_starts,
           fragment_pair, fragment_pixel, distance, depth, bary1, bary2);
}

void Rasterize::forward(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles,
                        const Bin& bin) {
  cover(p, triangles, bin);
  forward(p, triangles, bin, whole_frame(p, counted()));
}

void Rasterize::forward_within(const FrameCounts& room, const shared::FrameParams& p,
                               const Buffer<shared::Triangle>& triangles, const Bin& bin) {
  counted_ = false;
  count(p, triangles, bin);
  const std::size_t last_row = device_rows_.size() - 1;
  last_row_.start(device_rows_, last_row);
  fit_(device_.local_size() * device_.info.compute_units, static_cast<cl_uint>(bin.pairs),
       static_cast<cl_uint>(pixels_of(p)), static_cast<cl_uint>(room.fragments),
       static_cast<cl_uint>(room.listed), static_cast<cl_uint>(last_row), device_rows_, masks,
       fragment_starts, pixel_starts);
  listed_fragments = room.listed;
  forward(p, triangles, bin, whole_frame(p, room));
}

FrameCounts Rasterize::read_counts() {
  const cl_uint4 last = last_row_.take();
  return {last.s[3], last.s[1], last.s[2]};
}

Band Rasterize::settle(const shared::FrameParams& p, const FrameCounts& counts) {
  band = whole_frame(p, counts);
  fragments = counts.fragments;
  listed_fragments = counts.listed;
  counted_ = true;
  masks.settle(counts.pairs);
  fragment_starts.settle(counts.pairs + 1);
  list.settle(counts.listed);
  for (Buffer<cl_uint>* buffer : {&fragment_pair, &fragment_pixel}) buffer->settle(fragments);
  for (Buffer<float>* buffer : {&distance, &depth, &bary1, &bary2}) buffer->settle(fragments);
  return *band;
}

FrameCounts Rasterize::room_for(const FrameCounts& counts, const Bin& bin) const {
  const auto room = [](std::size_t count, std::size_t made_for) {
    return std::min(with_headroom(count), std::max(count, made_for));
  };
  return {room(counts.pairs, bin.pair_face.room()), room(counts.fragments, distance.room()),
          room(counts.listed, list.room())};
}

void Rasterize::backward(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles,
                         const Bin& bin, const Buffer<float>& grad_distance, const Buffer<float>& grad_depth,
                         const Buffer<float>& grad_bary1, const Buffer<float>& grad_bary2) {
  const Range range = pairs(bin);
  grad_corners.resize(device_, std::size_t{9} * bin.pairs);
  backward_(range, p, range.last(), triangles, bin.pair_face, masks, fragment_starts, fragment_pixel,
            distance, grad_distance, grad_depth, grad_bary1, grad_bary2, grad_corners);
}

std::size_t Rasterize::bytes() const {
  std::size_t bytes = scan_.bytes() + masks.capacity_bytes() + device_rows_.capacity_bytes();
  for (const Buffer<cl_uint>* buffer :
       {&fragment_starts, &pixel_starts, &list, &fragment_pair, &fragment_pixel, &counts_,
        &frame_fragment_starts_, &frame_pixel_starts_}) {
    bytes += buffer->capacity_bytes();
  }
  for (const Buffer<float>* buffer : {&distance, &depth, &bary1, &bary2, &grad_corners}) {
    bytes += buffer->capacity_bytes();
  }
  return bytes;
}

}  // namespace dpr
