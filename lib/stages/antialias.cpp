#include "stages/antialias.hpp"

#include <algorithm>

namespace dpr {
namespace {

constexpr std::size_t k_tile_bytes = 2 * DPR_TILE;  // as kernels/visibility.h has them

// Rows of tiles around those that are wanted for which a kernel runs. A tile's seconds are read two tiles away
// (DPR_NEAR_TILES), and read samples and steps two tiles from their own; all else, one tile away.
constexpr std::size_t k_blended_around = 1;                  // gradients through the blend
constexpr std::size_t k_read_around = k_blended_around + 3;  // those that they are made of
constexpr std::size_t k_listed_around =
    k_blended_around + 2;  // seconds, and what they and steps read: faded samples
constexpr std::size_t k_crossed_around = k_listed_around + 2;     // crossings
static_assert(Antialias::k_rows_around == k_crossed_around + 1);  // samples that decide what hides them

/// Work-items of a tile, as kernels/tile_rows.h has them.
std::size_t row_items(const Device::Impl& device) { return device.info.lanes == 1 ? DPR_TILE : 1; }

}  // namespace

void Antialias::find_front(const shared::FrameParams& p, const Bin& bin, const Rasterize& rasterize,
                           const Contour& contour, cl_uint layers) {
  front.resize(device_, pixels_of(p));
  front_face.resize(device_, pixels_of(p));
  const Range tiles = rasterize.tiles(p);
  const std::size_t items = row_items(device_);
  shared::FrameParams of_band = p;
  of_band.last_tile = tiles.last();
  launch_(Range{tiles.first * items, tiles.count * items},
          kernel::antialias_front{.p = of_band,
                                  .layers = layers,
                                  .tile_starts = contour.tile_starts,
                                  .starts = rasterize.pixel_starts,
                                  .list = rasterize.list,
                                  .fragments = rasterize.values,
                                  .fragment_pair = rasterize.fragment_pair,
                                  .pair_face = bin.pair_face,
                                  .front = front,
                                  .front_face = front_face});
}

TileLaunch Antialias::launch_around(const shared::FrameParams& p, const std::optional<Range>& wanted,
                                    std::size_t around) const {
  return {p, with_rows_around(p, wanted.value_or(window_of(p)), around), row_items(device_)};
}

void Antialias::cross(const ContourInputs& in, const Contour& contour, const Antialias& fronts,
                      const std::optional<Range>& wanted) {
  winner.resize(device_, 2 * pixels_of(in.p));
  cut.resize(device_, 2 * pixels_of(in.p));
  const std::size_t tiles = window_of(in.p).count * in.p.tiles_x;
  crowded_.resize(device_, k_tile_bytes * tiles);
  second_counts.resize(device_, tiles * row_items(device_));
  seconds.resize(device_, DPR_SECOND_CROSSINGS * DPR_TILE / 2 * tiles);
  const TileLaunch crossed = launch_around(in.p, wanted, k_crossed_around),
                   listed = launch_around(in.p, wanted, k_listed_around);
  launch_(crossed.items, kernel::antialias_cross{.p = crossed.p,
                                                 .views = in.views.cameras,
                                                 .edges = in.edges.edges,
                                                 .faces = in.geometry.face_vertices,
                                                 .ndc = in.transform.ndc,
                                                 .clipped = in.clipped,
                                                 .tile_starts = contour.tile_starts,
                                                 .pair_contour = contour.pair_contour,
                                                 .front = fronts.front,
                                                 .winner = winner,
                                                 .cut = cut,
                                                 .crowded = crowded_});
  launch_(listed.items, kernel::antialias_second_find{.p = listed.p,
                                                      .views = in.views.cameras,
                                                      .edges = in.edges.edges,
                                                      .faces = in.geometry.face_vertices,
                                                      .ndc = in.transform.ndc,
                                                      .clipped = in.clipped,
                                                      .tile_starts = contour.tile_starts,
                                                      .pair_contour = contour.pair_contour,
                                                      .front = fronts.front,
                                                      .front_face = fronts.front_face,
                                                      .winner = winner,
                                                      .crowded = crowded_,
                                                      .counts = second_counts,
                                                      .seconds = seconds});
}

void Antialias::forward(const shared::FrameParams& p, const Contour& contour, Buffer<cl_float4>& samples,
                        KeptSamples& kept, const std::optional<Range>& wanted) {
  const TileLaunch faded = launch_around(p, wanted, k_listed_around), blended = launch_around(p, wanted, 0);
  kept.samples.resize(device_, pixels_of(p));
  kept.faded.resize(device_, pixels_of(p));
  kept.shares.resize(device_, pixels_of(p));
  launch_(faded.items, kernel::antialias_fade{.p = faded.p,
                                              .tile_starts = contour.tile_starts,
                                              .winner = winner,
                                              .cut = cut,
                                              .raster = samples,
                                              .kept = kept.samples,
                                              .faded_raster = kept.faded,
                                              .shares = kept.shares});
  launch_(blended.items, kernel::antialias_forward{.p = blended.p,
                                                   .tile_starts = contour.tile_starts,
                                                   .winner = winner,
                                                   .cut = cut,
                                                   .raster = kept.faded,
                                                   .blended = samples});
  launch_(blended.items, kernel::antialias_second_forward{.p = blended.p,
                                                          .tile_starts = contour.tile_starts,
                                                          .counts = second_counts,
                                                          .seconds = seconds,
                                                          .winner = winner,
                                                          .cut = cut,
                                                          .raster = kept.faded,
                                                          .blended = samples});
}

namespace {

/// Gradients or tangents of cuts, in memory of others.
BufferRef<cl_float2> cuts_in(Device::Impl& device, const AntialiasScratch& scratch, std::size_t cuts) {
  scratch.cuts.resize(device, 2 * cuts);
  return BufferRef<cl_float2>(scratch.cuts.cl_buffer()());
}

}  // namespace

void Antialias::backward(const ContourInputs& in, const Contour& contour, const KeptSamples& kept,
                         Buffer<cl_float4>& grad, const AntialiasScratch& scratch,
                         const std::optional<Range>& wanted) {
  const std::size_t samples = pixels_of(in.p);
  const TileLaunch read = launch_around(in.p, wanted, k_read_around),
                   blended = launch_around(in.p, wanted, k_blended_around),
                   own = launch_around(in.p, wanted, 0);
  const BufferRef<cl_float2> grad_cut = cuts_in(device_, scratch, 2 * samples);
  grad_seconds_.resize(device_, seconds.size());
  Buffer<cl_float4>& kept_grad = scratch.samples;
  kept_grad.resize(device_, samples);
  grad_ends.resize(device_, contour.pairs);
  launch_(read.items, kernel::antialias_keep{
                          .p = read.p, .tile_starts = contour.tile_starts, .from = grad, .kept = kept_grad});
  launch_(blended.items, kernel::antialias_backward{.p = blended.p,
                                                    .tile_starts = contour.tile_starts,
                                                    .winner = winner,
                                                    .cut = cut,
                                                    .raster = kept.faded,
                                                    .grad_blended = kept_grad,
                                                    .grad_cut = grad_cut,
                                                    .grad_raster = grad});
  launch_(blended.items, kernel::antialias_second_backward{.p = blended.p,
                                                           .tile_starts = contour.tile_starts,
                                                           .counts = second_counts,
                                                           .seconds = seconds,
                                                           .winner = winner,
                                                           .cut = cut,
                                                           .raster = kept.faded,
                                                           .grad_blended = kept_grad,
                                                           .grad_cut = grad_cut,
                                                           .grad_raster = grad,
                                                           .grad_seconds = grad_seconds_});
  launch_(blended.items,
          kernel::antialias_keep{
              .p = blended.p, .tile_starts = contour.tile_starts, .from = grad, .kept = kept_grad});
  launch_(own.items, kernel::antialias_fade_backward{.p = own.p,
                                                     .tile_starts = contour.tile_starts,
                                                     .winner = winner,
                                                     .cut = cut,
                                                     .raster = kept.samples,
                                                     .shares = kept.shares,
                                                     .grad_faded = kept_grad,
                                                     .grad_cut = grad_cut,
                                                     .grad_raster = grad});
  launch_(contour.pairs, kernel::antialias_cross_backward{.p = own.p,
                                                          .pairs = contour.pair_count,
                                                          .edges = in.edges.edges,
                                                          .faces = in.geometry.face_vertices,
                                                          .ndc = in.transform.ndc,
                                                          .clipped = in.clipped,
                                                          .pair_contour = contour.pair_contour,
                                                          .pair_tile = contour.pair_tile,
                                                          .winner = winner,
                                                          .grad_cut = grad_cut,
                                                          .second_counts = second_counts,
                                                          .seconds = seconds,
                                                          .grad_seconds = grad_seconds_,
                                                          .grad_ends = grad_ends});
}

void Antialias::tangent(const ContourInputs& in, const Contour& contour, const KeptSamples& kept,
                        const Tangents& tangents, Buffer<cl_float4>& samples,
                        const AntialiasScratch& scratch) {
  if (!tangent_) tangent_.emplace(device_);
  // What the backward pass has of cuts and samples holds their tangents; seconds follow the cuts.
  const TileLaunch all = launch_around(in.p, {}, 0);
  const cl_uint directions = tangents.params.directions;
  const BufferRef<cl_float2> cut_tangents =
      cuts_in(device_, scratch, directions * (2 * pixels_of(in.p) + seconds.size()));
  Buffer<cl_float4>& faded_tangents = scratch.samples;
  faded_tangents.resize(device_, directions * pixels_of(in.p));
  (*tangent_)(contour.pairs, kernel::antialias_cross_tangent{
                                 .p = in.p,
                                 .directions_pairs = cl_uint2{{directions, to_uint(contour.pairs)}},
                                 .edges = in.edges.edges,
                                 .faces = in.geometry.face_vertices,
                                 .ndc = in.transform.ndc,
                                 .clipped = in.clipped,
                                 .pair_contour = contour.pair_contour,
                                 .pair_tile = contour.pair_tile,
                                 .winner = winner,
                                 .second_counts = second_counts,
                                 .seconds = seconds,
                                 .vertices = tangents.ndc,
                                 .outlines = tangents.outlines,
                                 .cut_tangents = cut_tangents});
  (*tangent_)(all.items, kernel::antialias_fade_tangent{.p = all.p,
                                                        .directions = directions,
                                                        .tile_starts = contour.tile_starts,
                                                        .winner = winner,
                                                        .cut = cut,
                                                        .raster = kept.samples,
                                                        .cut_tangents = cut_tangents,
                                                        .raster_tangents = samples,
                                                        .faded_tangents = faded_tangents});
  (*tangent_)(all.items, kernel::antialias_blend_tangent{.p = all.p,
                                                         .directions = directions,
                                                         .tile_starts = contour.tile_starts,
                                                         .winner = winner,
                                                         .cut = cut,
                                                         .raster = kept.faded,
                                                         .cut_tangents = cut_tangents,
                                                         .faded_tangents = faded_tangents,
                                                         .tangents = samples});
  (*tangent_)(all.items, kernel::antialias_second_tangent{.p = all.p,
                                                          .directions = directions,
                                                          .tile_starts = contour.tile_starts,
                                                          .counts = second_counts,
                                                          .seconds = seconds,
                                                          .winner = winner,
                                                          .cut = cut,
                                                          .raster = kept.faded,
                                                          .cut_tangents = cut_tangents,
                                                          .faded_tangents = faded_tangents,
                                                          .tangents = samples});
}

std::size_t Antialias::bytes() const {
  std::size_t bytes = winner.capacity_bytes() + crowded_.capacity_bytes() + second_counts.capacity_bytes() +
                      seconds.capacity_bytes() + grad_ends.capacity_bytes() + front.capacity_bytes() +
                      front_face.capacity_bytes();
  for (const Buffer<cl_float2>* buffer : {&cut, &grad_seconds_}) bytes += buffer->capacity_bytes();
  return bytes;
}

}  // namespace dpr
