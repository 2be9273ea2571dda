#include "stages/bin.hpp"

namespace dpr {

Bin::Bin(Device::Impl& device)
    : device_(device),
      count_(device, "bin.cl", "bin_count"),
      fill_(device, "bin.cl", "bin_fill"),
      scan_(device),
      sort_(device) {}

void Bin::forward(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles) {
  const std::size_t faces = std::size_t{p.views} * p.faces;
  counts_.resize(device_, faces);
  count_(faces, p, triangles, counts_);
  scan_(faces, counts_, pair_starts);
  pairs = read_total(pair_starts, faces, "pairs of tiles and triangles (frame)");

  for (Buffer<cl_uint>* buffer : {&pair_face, &pair_tile, &order, &sorted_tiles_})
    buffer->resize(device_, pairs);
  fill_(faces, p, triangles, pair_starts, pair_face, pair_tile, order);
  pair_tile.copy_to(sorted_tiles_);
  sort_(pairs, std::size_t{p.views} * p.tiles_x * p.tiles_y, sorted_tiles_, order, tile_starts);
}

std::size_t Bin::bytes() const {
  std::size_t bytes = scan_.bytes() + sort_.bytes();
  for (const Buffer<cl_uint>* buffer :
       {&pair_starts, &pair_face, &pair_tile, &order, &tile_starts, &counts_, &sorted_tiles_}) {
    bytes += buffer->capacity_bytes();
  }
  return bytes;
}

}  // namespace dpr
