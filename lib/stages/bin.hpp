// (tile, triangle) pairs, numbered by tile and, within a tile, by face; and every face's list of its pairs,
// by which gradients are gathered.
#pragma once

#include <limits>

#include "kernels/bin.hpp"
#include "stages/scan.hpp"
#include "stages/setup.hpp"
#include "stages/sort.hpp"

namespace dpr {

/// Pairs whose gradients, nine numbers each, kernels index by 32 bits.
inline constexpr std::size_t k_most_pairs = std::numeric_limits<cl_uint>::max() / 9;

class Bin {
 public:
  explicit Bin(Device::Impl& device) : device_(device), launch_(device), scan_(device), sort_(device) {}

  /// Makes runs of the setup's counts, which `pair_starts` holds. Before forward(), which empties them where
  /// the pairs do not fit.
  void start();
  /// Blocks to read the number of pairs.
  void forward(const shared::FrameParams& p, const Setup& setup);
  /// Does not wait to learn how many pairs there are. If they exceed the capacity, all are left out.
  /// Kernels are launched for as many as are likely.
  void forward(const shared::FrameParams& p, const Setup& setup, std::size_t capacity, std::size_t likely);
  /// Says how many pairs there are, after a forward() that did not wait for it.
  void settle(std::size_t known_pairs);

  std::size_t pairs = 0;        ///< or the capacity, until the number is known
  std::size_t launched = 0;     ///< work-items for all of them, which take several each where there are more
  Buffer<cl_uint> pair_count;   ///< [1] how many there are, 0 where they do not fit
  Buffer<cl_uint> pair_face;    ///< [pair] view * faces + face
  Buffer<cl_uint> pair_tile;    ///< [pair] view * tiles + tile
  Buffer<cl_uint> tile_starts;  ///< [view * tile + 1] runs of pairs
  Buffer<cl_uint> face_pairs;   ///< [place] the pairs of every face of every view, or DPR_NO_PAIR
  Buffer<cl_uint> pair_starts;  ///< [view * face + 1] runs of `face_pairs`
  Buffer<cl_uint> place_face;   ///< [place] view * faces + face
  Buffer<cl_uint> places;       ///< [pair] where its face lists it

  std::size_t bytes() const;

 private:
  void list(const shared::FrameParams& p, const Setup& setup, std::size_t capacity, std::size_t likely);

  Device::Impl& device_;
  Launcher<kernel::bin_fill, kernel::bin_link> launch_;
  Scan scan_;
  Sort sort_;
};

}  // namespace dpr
