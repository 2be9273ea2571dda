#include "stages/bin.hpp"

#include <algorithm>

namespace dpr {

void Bin::start() { scan_(pair_starts.size() - 1, pair_starts); }

void Bin::forward(const shared::FrameParams& p, const Setup& setup) {
  const std::size_t faces = pair_starts.size() - 1;
  const std::size_t found =
      read_total(pair_starts, faces, "pairs of tiles and triangles (frame)", k_most_pairs);
  list(p, setup, found, found);
  settle(found);
}

void Bin::forward(const shared::FrameParams& p, const Setup& setup, std::size_t capacity,
                  std::size_t likely) {
  list(p, setup, capacity, likely);
}

void Bin::settle(std::size_t known_pairs) {
  pairs = known_pairs;
  for (Buffer<cl_uint>* buffer : {&pair_face, &pair_tile, &face_pairs, &place_face, &places})
    buffer->settle(known_pairs);
}

void Bin::list(const shared::FrameParams& p, const Setup& setup, std::size_t capacity, std::size_t likely) {
  pairs = capacity;
  launched = std::min(capacity, likely);
  pair_count.resize(device_, 1);
  for (Buffer<cl_uint>* buffer : {&pair_face, &pair_tile, &face_pairs, &place_face})
    buffer->resize(device_, Length::at_most(pairs));
  const auto n = static_cast<cl_uint>(pairs);
  launch_(pair_starts.size() - 1, kernel::bin_fill{.p = p,
                                                   .capacity = n,
                                                   .triangles = setup.triangles,
                                                   .offsets = pair_starts,
                                                   .pairs = pair_count,
                                                   .place_face = place_face,
                                                   .place_tile = pair_tile});
  sort_(pairs, pair_count, std::size_t{p.views} * p.tiles_x * p.tiles_y, pair_tile, places, tile_starts);
  launch_(launched, kernel::bin_link{.pairs = pair_count,
                                     .places = places,
                                     .place_owner = place_face,
                                     .pair_owner = pair_face,
                                     .owner_pairs = face_pairs});
}

std::size_t Bin::bytes() const {
  std::size_t bytes = scan_.bytes() + sort_.bytes();
  for (const Buffer<cl_uint>* buffer :
       {&pair_count, &pair_face, &pair_tile, &tile_starts, &face_pairs, &pair_starts, &place_face, &places}) {
    bytes += buffer->capacity_bytes();
  }
  return bytes;
}

}  // namespace dpr
