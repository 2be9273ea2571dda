#include "stages/rasterize.hpp"

namespace dpr {

Rasterize::Rasterize(Device::Impl& device)
    : device_(device),
      cover_(device, "rasterize.cl", "rasterize_cover"),
      count_(device, "rasterize.cl", "rasterize_count"),
      list_(device, "rasterize.cl", "rasterize_list"),
      forward_(device, "rasterize.cl", "rasterize_forward"),
      backward_(device, "rasterize.cl", "rasterize_backward"),
      scan_(device) {}

void Rasterize::forward(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles,
                        const Bin& bin) {
  const auto pairs = static_cast<cl_uint>(bin.pairs);
  const std::size_t pixels = std::size_t{p.views} * p.width * p.height;
  masks.resize(device_, pairs);
  counts_.resize(device_, std::max<std::size_t>(pairs, pixels));
  cover_(pairs, p, pairs, triangles, bin.pair_face, bin.pair_tile, masks, counts_);
  scan_(pairs, counts_, fragment_starts);

  const std::size_t vectors = std::size_t{p.views} * p.tiles_x * p.tiles_y * DPR_TILE * DPR_TILE /
                              std::min<std::size_t>(device_.info.lanes, DPR_TILE);
  count_(vectors, p, bin.tile_starts, masks, counts_);
  scan_(pixels, counts_, pixel_starts);
  fragments = read_total(fragment_starts, pairs, "fragments (frame)");
  listed_fragments = read_total(pixel_starts, pixels, "fragments (frame)");

  list.resize(device_, listed_fragments);
  list_(vectors, p, bin.tile_starts, masks, fragment_starts, pixel_starts, list);
  for (Buffer<cl_uint>* buffer : {&fragment_pair, &fragment_pixel}) buffer->resize(device_, fragments);
  for (Buffer<float>* buffer : {&distance, &depth, &bary1, &bary2}) buffer->resize(device_, fragments);
  forward_(pairs, p, pairs, triangles, bin.pair_face, bin.pair_tile, masks, fragment_starts, fragment_pair,
           fragment_pixel, distance, depth, bary1, bary2);
}

void Rasterize::backward(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles,
                         const Bin& bin, const Buffer<float>& grad_distance, const Buffer<float>& grad_depth,
                         const Buffer<float>& grad_bary1, const Buffer<float>& grad_bary2) {
  const auto pairs = static_cast<cl_uint>(bin.pairs);
  grad_corners.resize(device_, std::size_t{9} * pairs);
  backward_(pairs, p, pairs, triangles, bin.pair_face, masks, fragment_starts, fragment_pixel, grad_distance,
            grad_depth, grad_bary1, grad_bary2, grad_corners);
}

std::size_t Rasterize::bytes() const {
  std::size_t bytes = scan_.bytes() + masks.capacity_bytes();
  for (const Buffer<cl_uint>* buffer :
       {&fragment_starts, &pixel_starts, &list, &fragment_pair, &fragment_pixel, &counts_}) {
    bytes += buffer->capacity_bytes();
  }
  for (const Buffer<float>* buffer : {&distance, &depth, &bary1, &bary2, &grad_corners}) {
    bytes += buffer->capacity_bytes();
  }
  return bytes;
}

}  // namespace dpr
