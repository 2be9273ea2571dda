// The smaller levels of textures; and gradients of texels, gathered from what fragments see of them.
#pragma once

#include <optional>

#include "kernels/texels.hpp"
#include "stages/geometry.hpp"
#include "stages/sort.hpp"
#include "stages/surface.hpp"

namespace dpr {

class Texels {
 public:
  explicit Texels(Device::Impl& device);

  /// Fills the smaller levels from the largest, of texels or of their opacities.
  void build(const Textures& textures, Buffer<cl_float4>& values);
  /// Before the first band of a frame.
  void start(const Textures& textures);
  /// Adds a band's fragments, as Surface::list() left them; their order is lost there.
  void add(const Textures& textures, Surface& surface);
  /// Adds the gradients of smaller levels to the largest's, after the last band.
  void finish(const Textures& textures);

  Buffer<cl_float4> grad;  ///< [texel]; those of the largest levels are the textures' own

  std::size_t bytes() const;
  /// Bytes a fragment of the buffers below, of two levels.
  static std::size_t fragment_bytes(const Device::Impl& device);

 private:
  /// Fills the tables of sums by tile, and empties the list of texels that groups add up.
  void find_runs(const Textures& textures, const Surface& surface);

  Device::Impl& device_;
  Sort sort_;
  Launcher<kernel::texels_sum, kernel::texels_shrink, kernel::texels_shrink_backward> launch_;
  std::optional<Launcher<kernel::texels_runs, kernel::texels_sum_shared>> share_;  // on GPUs
  Buffer<cl_uint> starts_;  // [texel + 2] runs of fragments by cell; the last cell is that of no texture
  Buffer<cl_uint> tiles_, shared_;  // on GPUs: [place] in order of cells; texels that groups add up
  Buffer<cl_float4> sums_;          // on GPUs: [place / DPR_TEXEL_RUN][4]
};

}  // namespace dpr
