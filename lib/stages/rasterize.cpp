#include "stages/rasterize.hpp"

#include <algorithm>
#include <utility>

namespace dpr {

namespace {

/// Work-items of the listing kernels for a tile: as rasterize.cl shares it out.
std::size_t shares_of_tile(const Device::Impl& device) {
  return device.info.lanes == 1 ? std::size_t{DPR_TILE} * DPR_TILE : 1;
}

std::size_t pixels_of(const shared::FrameParams& p) { return std::size_t{p.views} * p.width * p.height; }
std::size_t tiles_of(const shared::FrameParams& p) { return std::size_t{p.views} * p.tiles_x * p.tiles_y; }

Band whole_frame(const shared::FrameParams& p, const FrameCounts& counts) {
  return {tiles_of(p), counts.pairs, {0, pixels_of(p)}, counts.fragments};
}

/// The pixels of a stretch of tiles: of whole rows, or of a part of one.
PixelBlock pixel_block(const shared::FrameParams& p, const Range& tiles) {
  const auto first_pixel = [&](std::size_t row) {
    return (row / p.tiles_y * p.height + row % p.tiles_y * DPR_TILE) * p.width;
  };
  const std::size_t row = tiles.first / p.tiles_x, column = tiles.first % p.tiles_x * DPR_TILE;
  if (tiles.count % p.tiles_x == 0) {
    return {first_pixel(row), first_pixel(row + tiles.count / p.tiles_x) - first_pixel(row)};
  }
  return {first_pixel(row) + column, std::min<std::size_t>(tiles.count * DPR_TILE, p.width - column),
          std::min<std::size_t>(DPR_TILE, p.height - row % p.tiles_y * DPR_TILE), p.width};
}

/// The first of the starts of any list is 0.
ContourCount no_contours(Bin& bin) { return {0, bin.pair_starts}; }

/// From a plane to the next: what is loaded behind the last fragment belongs to none.
cl_uint plane_size(std::size_t fragments) { return to_uint(fragments + k_widest_vector); }

std::size_t bytes_of_band(std::size_t fragments, std::size_t bytes_each) {
  return with_headroom(fragments + k_widest_vector) * bytes_each;
}

std::vector<float> read_plane(const Buffer<float>& planes, std::size_t first, std::size_t fragments) {
  std::vector<float> values(fragments);
  planes.download(values, first);
  return values;
}

template <class Start>
Band make_band(const shared::FrameParams& p, const Start& first, const Start& last) {
  const auto between = [](std::size_t begin, std::size_t end) { return Range(begin, end - begin); };
  const Range tiles = between(first.tile, last.tile);
  return {tiles, between(first.pair, last.pair), pixel_block(p, tiles),
          between(first.fragment, last.fragment)};
}

}  // namespace

PairGroups::PairGroups(const Device::Impl& device, const Range& of, std::size_t launched)
    : pairs{{static_cast<cl_uint>(of.first), of.last()}} {
  const std::size_t size = device.info.lanes == 1 ? 1 : DPR_PAIR_GROUP;
  count = (std::min(of.count, launched) + size - 1) / size;
}

void Rasterize::count(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, Bin& bin,
                      const ContourCount& contours) {
  const auto pairs = static_cast<cl_uint>(bin.pairs);
  const std::size_t pixels = pixels_of(p);
  masks.resize(device_, length(pairs));
  fragment_starts.resize(device_, length(std::size_t{pairs} + 1));
  launch_(bin.launched, kernel::rasterize_cover{.p = p,
                                                .pairs = bin.pair_count,
                                                .triangles = triangles,
                                                .pair_face = bin.pair_face,
                                                .pair_tile = bin.pair_tile,
                                                .masks = masks,
                                                .counts = fragment_starts});
  if (clip != nullptr) clip->cover(p, triangles, bin, masks, fragment_starts);
  if (hiding) {
    launch_.in_groups(tiles_of(p), kernel::rasterize_hide{.p = p,
                                                          .reach = hiding->reach,
                                                          .views = hiding->cameras,
                                                          .tile_starts = bin.tile_starts,
                                                          .triangles = triangles,
                                                          .pair_face = bin.pair_face,
                                                          .places = bin.places,
                                                          .masks = masks,
                                                          .counts = fragment_starts,
                                                          .face_pairs = bin.face_pairs});
  }
  scan_(pairs, bin.pair_count, fragment_starts);
  pixel_starts.resize(device_, pixels + 1);
  launch_(tiles_of(p) * shares_of_tile(device_),
          kernel::rasterize_count{
              .p = p, .tile_starts = bin.tile_starts, .masks = masks, .counts = pixel_starts});
  scan_(pixels, pixel_starts);

  const std::size_t rows = std::size_t{p.views} * p.tiles_y;
  device_rows_.resize(device_, rows + 1);
  launch_(rows + 1, kernel::rasterize_rows{.p = p,
                                           .last_contour = to_uint(contours.last),
                                           .tile_starts = bin.tile_starts,
                                           .pair_starts = bin.pair_starts,
                                           .fragment_starts = fragment_starts,
                                           .contour_starts = contours.starts,
                                           .rows = device_rows_});
  in_bands_ = false;
}

void Rasterize::cover(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, Bin& bin) {
  counted_ = true;
  count(p, triangles, bin, no_contours(bin));
  read_rows(p);
  check_total(row_starts_.back().fragment, "fragments (frame)");
  frame_fragments = likely_fragments_ = row_starts_.back().fragment;
}

void Rasterize::read_rows(const shared::FrameParams& p) {
  row_starts_.clear();
  for (const cl_uint4& row : device_rows_.download()) {
    row_starts_.push_back({row_starts_.size() * p.tiles_x, row.s[0], row.s[1]});
  }
}

FrameCounts Rasterize::counted() const { return {row_starts_.back().pair, row_starts_.back().fragment}; }

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

std::vector<Band> Rasterize::cut(const shared::FrameParams& p, const Bin& bin, std::size_t budget,
                                 std::size_t fragment_bytes) const {
  const auto bytes_of = [&](std::size_t number) { return bytes_of_band(number, fragment_bytes); };
  std::vector<TileStart> cuts;
  for (std::size_t row = 0; row + 1 < row_starts_.size(); ++row) {
    const bool fits = bytes_of(row_starts_[row + 1].fragment - row_starts_[row].fragment) <= budget;
    const std::vector<TileStart> tiles = fits ? std::vector{row_starts_[row]} : tile_starts(p, bin, row);
    cuts.insert(cuts.end(), tiles.begin(), tiles.end());
  }
  cuts.push_back(row_starts_.back());
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
  const std::size_t total = cuts.back().fragment, least_bands = bytes_of(total) / budget + 1;
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

void Rasterize::forward(shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, const Bin& bin,
                        const Band& next) {
  if (next.tiles.count < tiles_of(p)) rebase(next);
  band = next;
  fragments = next.fragments.count;
  p.fragments = p.grad_fragments = plane_size(fragments);
  p.pairs = to_uint(bin.pairs);
  p.last_pair = next.pairs.last();
  for (Buffer<cl_uint>* buffer : {&list, &fragment_pair, &fragment_pixel})
    buffer->resize(device_, fragment_length());
  values.resize(device_, length((DPR_PLANE_BASE + 3 * std::size_t{p.has_base}) * p.fragments));
  const std::size_t shares = shares_of_tile(device_);
  const Range listing(next.tiles.first * shares, next.tiles.count * shares);
  launch_(listing, kernel::rasterize_list{.p = p,
                                          .last_share = listing.last(),
                                          .tile_starts = bin.tile_starts,
                                          .masks = masks,
                                          .fragment_starts = fragment_starts,
                                          .pixel_starts = pixel_starts,
                                          .lists = list});
  const PairGroups groups(device_, next.pairs, bin.launched);
  launch_(groups.count, kernel::rasterize_forward{.p = p,
                                                  .range = groups.pairs,
                                                  .pairs = bin.pair_count,
                                                  .triangles = triangles,
                                                  .pair_face = bin.pair_face,
                                                  .pair_tile = bin.pair_tile,
                                                  .masks = masks,
                                                  .fragment_starts = fragment_starts,
                                                  .fragment_pair = fragment_pair,
                                                  .pixels = fragment_pixel,
                                                  .fragments = values});
  if (clip != nullptr) clip->fragments(p, triangles, bin, *this);
}

void Rasterize::forward(shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, Bin& bin) {
  cover(p, triangles, bin);
  forward(p, triangles, bin, whole_frame(p, counted()));
}

void Rasterize::forward_within(const FrameCounts& capacity, std::size_t likely_fragments,
                               shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, Bin& bin,
                               const std::optional<ContourCount>& contours, bool reads) {
  const ContourCount contour_count = contours ? *contours : no_contours(bin);
  counted_ = false;
  likely_fragments_ = likely_fragments;
  count(p, triangles, bin, contour_count);
  const std::size_t last_row = device_rows_.size() - 1;
  const cl_uint4 limits{{to_uint(bin.pairs), to_uint(capacity.fragments), to_uint(capacity.contours), 0}};
  const cl_uint4 sizes{
      {to_uint(pixels_of(p)), p.views * p.faces, to_uint(contour_count.last), to_uint(last_row)}};
  if (reads) {
    last_row_.start(device_rows_, last_row);
  } else {
    launch_(
        1,
        kernel::rasterize_note{
            .capacity = limits, .last_row = to_uint(last_row), .rows = device_rows_, .history = history()});
    if (notes_under_way_ < notes_.size())
      notes_[(oldest_note_ + notes_under_way_++) % notes_.size()].start(history_, 1);
  }
  launch_(device_.local_size() * device_.info.compute_units,
          kernel::rasterize_fit{.capacity = limits,
                                .sizes = sizes,
                                .rows = device_rows_,
                                .masks = masks,
                                .fragment_starts = fragment_starts,
                                .pixel_starts = pixel_starts,
                                .pair_starts = bin.pair_starts,
                                .contour_starts = contour_count.starts});
  frame_fragments = capacity.fragments;
  forward(p, triangles, bin, whole_frame(p, capacity));
}

FrameCounts Rasterize::read_counts() {
  if (!last_row_.is_started()) last_row_.start(device_rows_, device_rows_.size() - 1);
  const cl_uint4 last = last_row_.take();
  check_total(last.s[3], "pairs of tiles and contours (frame)");
  return {last.s[2], last.s[1], last.s[3]};
}

Buffer<cl_uint4>& Rasterize::history() {
  if (history_.size() == 0) {
    Buffer<cl_uint4> zero(device_, 2);
    zero.fill(cl_uint4{});
    history_ = std::move(zero);
  }
  return history_;
}

PendingRead<cl_uint4>& Rasterize::next_note() {
  PendingRead<cl_uint4>& note = notes_[oldest_note_];
  oldest_note_ = (oldest_note_ + 1) % notes_.size();
  --notes_under_way_;
  return note;
}

void Rasterize::forget_history() {
  while (notes_under_way_ > 0) next_note().take();
  noted_emptied_ = 0;
  disowned_notes_ = 0;
  history_.fill(cl_uint4{});
}

FrameNote Rasterize::poll_notes() {
  FrameNote note;
  while (notes_under_way_ > 0 && notes_[oldest_note_].has_arrived()) {
    const bool is_own = disowned_notes_ == 0;
    if (!is_own) --disowned_notes_;
    const cl_uint4 found = next_note().take_arrived();
    note.emptied += found.s[3] - std::exchange(noted_emptied_, found.s[3]);
    if (is_own) note.counts = larger(note.counts, {found.s[0], found.s[1], found.s[2]});
  }
  return note;
}

Band Rasterize::settle(shared::FrameParams& p, const FrameCounts& counts) {
  band = whole_frame(p, counts);
  p.grad_fragments = plane_size(counts.fragments);
  p.pairs = p.last_pair = to_uint(counts.pairs);
  fragments = frame_fragments = counts.fragments;
  counted_ = true;
  masks.settle(counts.pairs);
  fragment_starts.settle(counts.pairs + 1);
  for (Buffer<cl_uint>* buffer : {&list, &fragment_pair, &fragment_pixel}) buffer->settle(fragments);
  values.settle(values.length().count);
  return *band;
}

void Rasterize::start_gradients(const shared::FrameParams& p) {
  grads.resize(device_, (DPR_GRAD_PLANE_BASE + 3 * std::size_t{p.has_base}) * p.grad_fragments);
}

std::vector<float> Rasterize::plane(const shared::FrameParams& p, cl_uint number) const {
  return read_plane(values, std::size_t{number} * p.fragments, fragments);
}

std::vector<float> Rasterize::grad_plane(const shared::FrameParams& p, cl_uint number) const {
  return read_plane(grads, std::size_t{number} * p.grad_fragments, fragments);
}

void Rasterize::backward(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles,
                         const Bin& bin) {
  const Range range = pairs(bin);
  grad_corners.resize(device_, Length::varying(std::size_t{9} * bin.pairs));
  const Range launched(range.first, std::min(range.count, bin.launched));
  launch_(launched, kernel::rasterize_backward{.p = p,
                                               .last_pair = range.last(),
                                               .pairs = bin.pair_count,
                                               .triangles = triangles,
                                               .pair_face = bin.pair_face,
                                               .fragment_starts = fragment_starts,
                                               .pixels = fragment_pixel,
                                               .fragments = values,
                                               .grads = grads,
                                               .grad_corners = grad_corners});
  if (clip != nullptr) clip->backward(p, triangles, bin, *this);
}

void Rasterize::tangent(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles,
                        const Geometry& geometry, const Bin& bin, Tangents& tangents) {
  shared::TangentParams& q = tangents.params;
  q.planes = DPR_TANGENT_PLANES + 3 * p.has_base;
  q.base_plane = p.has_base != 0 ? DPR_TANGENT_PLANE_BASE : DPR_PLANE_COLOR;
  const std::size_t details = p.levels > 1 ? 3 : 0;
  tangents.fragments.resize(device_, (std::size_t{q.directions} * q.planes + details) * p.grad_fragments);
  const PairGroups groups = pair_groups(bin);
  launch_(groups.count, kernel::rasterize_tangent{.p = p,
                                                  .range = groups.pairs,
                                                  .q = tangents.params,
                                                  .pairs = bin.pair_count,
                                                  .triangles = triangles,
                                                  .pair_face = bin.pair_face,
                                                  .fragment_starts = fragment_starts,
                                                  .pixels = fragment_pixel,
                                                  .faces = geometry.face_vertices,
                                                  .vertices = tangents.ndc,
                                                  .fragments = values,
                                                  .tangents = tangents.fragments});
  if (clip != nullptr) clip->tangent(p, triangles, bin, *this, tangents);
}

std::size_t Rasterize::vectors() const {
  const std::size_t width = std::min<std::size_t>(device_.info.lanes, DPR_TILE);
  return (launched_fragments() + width - 1) / width;
}

std::size_t Rasterize::bytes() const {
  std::size_t bytes =
      scan_.bytes() + masks.capacity_bytes() + device_rows_.capacity_bytes() + history_.capacity_bytes();
  for (const Buffer<cl_uint>* buffer : {&fragment_starts, &pixel_starts, &list, &fragment_pair,
                                        &fragment_pixel, &frame_fragment_starts_, &frame_pixel_starts_}) {
    bytes += buffer->capacity_bytes();
  }
  for (const Buffer<float>* buffer : {&values, &grads, &grad_corners}) {
    bytes += buffer->capacity_bytes();
  }
  return bytes;
}

}  // namespace dpr
