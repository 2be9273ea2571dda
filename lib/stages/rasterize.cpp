#include "stages/rasterize.hpp"

#include <algorithm>
#include <utility>

namespace dpr {

namespace {

/// Work-items of the listing kernels for a tile: as rasterize.cl shares it out.
std::size_t shares_of_tile(const Device::Impl& device) {
  return device.info.lanes == 1 ? std::size_t{DPR_TILE} * DPR_TILE : 1;
}

Band whole_frame(const shared::FrameParams& p, const FrameCounts& counts) {
  return {tiles_of(p), counts.pairs, {0, pixels_of(p)}, counts.fragments};
}

/// The first of the starts of any list is 0.
ContourCount no_contours(Bin& bin) { return {0, bin.pair_starts}; }

/// From a plane to the next: what is loaded behind the last fragment belongs to none.
cl_uint plane_size(std::size_t fragments) { return to_uint(fragments + k_widest_vector); }

std::vector<float> read_plane(const Buffer<float>& planes, std::size_t first, std::size_t fragments) {
  std::vector<float> values(fragments);
  planes.download(values, first);
  return values;
}

}  // namespace

PairGroups::PairGroups(const Device::Impl& device, const Range& of, std::size_t launched)
    : pairs{{static_cast<cl_uint>(of.first), of.last()}} {
  const std::size_t size = device.info.lanes == 1 ? 1 : DPR_PAIR_GROUP;
  count = (std::min(of.count, launched) + size - 1) / size;
}

void Rasterize::count(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, Bin& bin,
                      const ContourCount& contours, bool counts_pixels) {
  const auto pairs = static_cast<cl_uint>(bin.pairs);
  in_bands_ = false;
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
  if (counts_pixels) count_pixels(p, bin);

  const std::size_t rows = std::size_t{p.views} * p.tiles_y;
  device_rows_.resize(device_, rows + 1);
  launch_(rows + 1, kernel::rasterize_rows{.p = p,
                                           .last_contour = to_uint(contours.last),
                                           .tile_starts = bin.tile_starts,
                                           .pair_starts = bin.pair_starts,
                                           .fragment_starts = fragment_starts,
                                           .contour_starts = contours.starts,
                                           .rows = device_rows_});
}

void Rasterize::count_pixels(const shared::FrameParams& p, const Bin& bin) {
  Buffer<cl_uint>& starts = in_bands_ ? frame_pixel_starts_ : pixel_starts;
  const TileLaunch tiles(p, window_of(p), shares_of_tile(device_));
  starts.resize(device_, pixels_of(p) + 1);
  launch_(tiles.items, kernel::rasterize_count{
                           .p = tiles.p, .tile_starts = bin.tile_starts, .masks = masks, .counts = starts});
  scan_(pixels_of(p), starts);
}

void Rasterize::cover(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, Bin& bin,
                      bool counts_pixels) {
  counted_ = true;
  count(p, triangles, bin, no_contours(bin), counts_pixels);
  read_rows(p);
  check_total(row_starts_.back().fragment, "fragments (frame)");
  frame_fragments = likely_fragments_ = row_starts_.back().fragment;
}

FrameCounts Rasterize::counted() const { return {row_starts_.back().pair, row_starts_.back().fragment}; }

void Rasterize::forward(shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, const Bin& bin,
                        const Band& next) {
  if (in_bands_ || next.tiles.count < tiles_of(p)) rebase(next);
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
  count(p, triangles, bin, contour_count, true);
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
