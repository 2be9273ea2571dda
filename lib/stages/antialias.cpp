#include "stages/antialias.hpp"

namespace dpr {
namespace {

constexpr std::size_t k_tile_words = 4;  // as kernels/visibility.h has them

std::size_t samples_of(const shared::FrameParams& p) { return std::size_t{p.views} * p.width * p.height; }

std::size_t tiles_of(const shared::FrameParams& p) { return std::size_t{p.views} * p.tiles_x * p.tiles_y; }

/// Work-items of a tile, as kernels/tile_rows.h has them.
std::size_t row_items(const Device::Impl& device) { return device.info.lanes == 1 ? DPR_TILE : 1; }

shared::AntialiasParams params(const ContourInputs& in, float depth_reach) {
  shared::AntialiasParams a{};
  a.edges = static_cast<cl_uint>(edges_of_view(in));
  a.mesh_edges = static_cast<cl_uint>(in.edges.count);
  a.depth_reach = depth_reach;
  return a;
}

}  // namespace

Antialias::Antialias(Device::Impl& device)
    : device_(device),
      front_(device, "antialias_cross.cl", "antialias_front"),
      cross_(device, "antialias_cross.cl", "antialias_cross"),
      second_find_(device, "antialias_second.cl", "antialias_second_find"),
      fade_(device, "antialias_fade.cl", "antialias_fade"),
      keep_(device, "antialias.cl", "antialias_keep"),
      forward_(device, "antialias.cl", "antialias_forward"),
      backward_(device, "antialias.cl", "antialias_backward"),
      second_forward_(device, "antialias_second.cl", "antialias_second_forward"),
      second_backward_(device, "antialias_second.cl", "antialias_second_backward"),
      fade_backward_(device, "antialias_fade.cl", "antialias_fade_backward"),
      cross_backward_(device, "antialias_cross.cl", "antialias_cross_backward") {}

void Antialias::find_front(const shared::FrameParams& p, const Rasterize& rasterize, const Contour& contour) {
  front.resize(device_, samples_of(p));
  const Range tiles = rasterize.tiles(p);
  const std::size_t rows = row_items(device_);
  front_(Range{tiles.first * rows, tiles.count * rows}, p, to_uint(tiles.last()), contour.tile_starts,
         rasterize.pixel_starts, rasterize.list, rasterize.depth, front);
}

void Antialias::cross(const ContourInputs& in, const Contour& contour, float depth_reach) {
  winner.resize(device_, 2 * samples_of(in.p));
  cut.resize(device_, 2 * samples_of(in.p));
  const std::size_t tiles = tiles_of(in.p);
  crowded_.resize(device_, k_tile_words * tiles);
  second_counts.resize(device_, tiles);
  seconds.resize(device_, DPR_SECOND_CROSSINGS * tiles);
  cross_(tiles, in.p, params(in, depth_reach), in.views.cameras, in.edges.edges, in.geometry.face_vertices,
         in.facing, in.transform.ndc, in.clipped, contour.tile_starts, contour.pair_contour, front, winner,
         cut, crowded_);
  second_find_(tiles, in.p, params(in, depth_reach), in.views.cameras, in.edges.edges,
               in.geometry.face_vertices, in.facing, in.transform.ndc, in.clipped, contour.tile_starts,
               contour.pair_contour, front, winner, crowded_, second_counts, seconds);
}

void Antialias::forward(const shared::FrameParams& p, const Contour& contour, Buffer<cl_float4>& samples,
                        KeptSamples& kept) {
  const std::size_t rows = tiles_of(p) * row_items(device_);
  kept.samples.resize(device_, samples_of(p));
  kept.faded.resize(device_, samples_of(p));
  kept.shares.resize(device_, samples_of(p));
  fade_(rows, p, contour.tile_starts, winner, cut, samples, kept.samples, kept.faded, kept.shares);
  forward_(rows, p, contour.tile_starts, winner, cut, kept.faded, samples);
  second_forward_(tiles_of(p), p, contour.tile_starts, second_counts, seconds, winner, cut, kept.faded,
                  samples);
}

void Antialias::backward(const ContourInputs& in, const Contour& contour, const KeptSamples& kept,
                         Buffer<cl_float4>& grad) {
  const std::size_t samples = samples_of(in.p), rows = tiles_of(in.p) * row_items(device_);
  grad_cut_.resize(device_, 2 * samples);
  grad_seconds_.resize(device_, seconds.size());
  kept_grad_.resize(device_, samples);
  grad_ends.resize(device_, contour.pairs);
  keep_(rows, in.p, contour.tile_starts, grad, kept_grad_);
  backward_(rows, in.p, contour.tile_starts, winner, cut, kept.faded, kept_grad_, grad_cut_, grad);
  second_backward_(tiles_of(in.p), in.p, contour.tile_starts, second_counts, seconds, winner, cut, kept.faded,
                   kept_grad_, grad_cut_, grad, grad_seconds_);
  keep_(rows, in.p, contour.tile_starts, grad, kept_grad_);
  fade_backward_(rows, in.p, contour.tile_starts, winner, cut, kept.samples, kept.shares, kept_grad_,
                 grad_cut_, grad);
  cross_backward_(contour.pairs, in.p, params(in, 0.0F), contour.pair_count, in.edges.edges,
                  in.geometry.face_vertices, in.facing, in.transform.ndc, in.clipped, contour.pair_contour,
                  contour.pair_tile, winner, grad_cut_, second_counts, seconds, grad_seconds_, grad_ends);
}

std::size_t Antialias::bytes() const {
  std::size_t bytes = kept_grad_.capacity_bytes() + winner.capacity_bytes() + crowded_.capacity_bytes() +
                      second_counts.capacity_bytes() + seconds.capacity_bytes() + grad_ends.capacity_bytes() +
                      front.capacity_bytes();
  for (const Buffer<cl_float2>* buffer : {&cut, &grad_cut_, &grad_seconds_})
    bytes += buffer->capacity_bytes();
  return bytes;
}

}  // namespace dpr
