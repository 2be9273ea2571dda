#include "stages/texels.hpp"

#include <algorithm>

namespace dpr {

namespace {

/// Texels of a level of a pyramid (kernels/pyramid.h).
std::size_t texels_of_level(const shared::Texture& texture, cl_uint level) {
  return std::size_t{std::max(texture.width >> level, 1U)} * std::max(texture.height >> level, 1U);
}

std::size_t texels_of(const shared::Texture& texture) {
  std::size_t texels = 0;
  for (cl_uint level = 0; level < texture.levels; ++level) texels += texels_of_level(texture, level);
  return texels;
}

/// Lengths of the buffers of GPUs.
std::size_t run_sums(std::size_t places) { return 4 * (places / DPR_TEXEL_RUN + 1); }
/// A place counts for four texels.
std::size_t most_shared(std::size_t places) { return 4 * places / DPR_SHARED_TEXEL; }

}  // namespace

Texels::Texels(Device::Impl& device) : device_(device), sort_(device), launch_(device) {
  if (device.info.lanes == 1) share_.emplace(device);
}

void Texels::build(const Textures& textures, Buffer<cl_float4>& values) {
  for (cl_uint i = 0; i < textures.list.size(); ++i) {
    const shared::Texture& t = textures.list[i];
    for (cl_uint level = 1; level < t.levels; ++level)
      launch_(texels_of_level(t, level),
              kernel::texels_shrink{
                  .number = i, .level = level, .textures = textures.textures, .texels = values});
  }
}

void Texels::start(const Textures& textures) {
  grad.resize(device_, textures.texels);
  grad.fill(cl_float4{});
}

void Texels::add(const Textures& textures, Surface& surface) {
  const std::size_t places = surface.cells.size();
  if (places == 0) return;
  sort_(places, surface.place_count, textures.texels + 1, surface.cells, surface.numbers, starts_);
  if (share_) find_runs(textures, surface);
  for (cl_uint i = 0; i < textures.list.size(); ++i) {
    const std::size_t texels = texels_of(textures.list[i]);
    launch_(texels, kernel::texels_sum{.number = i,
                                       .texels = to_uint(texels),
                                       .textures = textures.textures,
                                       .starts = starts_,
                                       .numbers = surface.numbers,
                                       .places = surface.seen,
                                       .tiles = tiles_,
                                       .sums = sums_,
                                       .shared = shared_,
                                       .grad = grad});
  }
  if (share_)
    share_->in_groups(most_shared(places), kernel::texels_sum_shared{.textures = textures.textures,
                                                                     .starts = starts_,
                                                                     .numbers = surface.numbers,
                                                                     .places = surface.seen,
                                                                     .tiles = tiles_,
                                                                     .sums = sums_,
                                                                     .shared = shared_,
                                                                     .grad = grad});
}

void Texels::find_runs(const Textures& textures, const Surface& surface) {
  const std::size_t places = surface.cells.size();
  tiles_.resize(device_, places);
  sums_.resize(device_, run_sums(places));
  shared_.resize(device_, 1 + 2 * most_shared(places));
  shared_.fill(0);
  share_->in_groups((places + DPR_TEXEL_BLOCK - 1) / DPR_TEXEL_BLOCK,
                    kernel::texels_runs{.textured = to_uint(textures.texels),
                                        .count = surface.place_count,
                                        .cells = surface.cells,
                                        .numbers = surface.numbers,
                                        .places = surface.seen,
                                        .tiles = tiles_,
                                        .sums = sums_});
}

void Texels::finish(const Textures& textures) {
  for (cl_uint i = 0; i < textures.list.size(); ++i) {
    const shared::Texture& t = textures.list[i];
    for (cl_uint level = t.levels; level-- > 1;)
      launch_(texels_of_level(t, level - 1),
              kernel::texels_shrink_backward{
                  .number = i, .level = level, .textures = textures.textures, .grad = grad});
  }
}

std::size_t Texels::bytes() const {
  return grad.capacity_bytes() + sort_.bytes() + starts_.capacity_bytes() + tiles_.capacity_bytes() +
         shared_.capacity_bytes() + sums_.capacity_bytes();
}

std::size_t Texels::fragment_bytes(const Device::Impl& device) {
  constexpr std::size_t k_sums = 4 * sizeof(cl_float4) / DPR_TEXEL_RUN, k_places = 2;
  return device.info.lanes == 1 ? k_places * (sizeof(cl_uint) + k_sums) : 0;
}

}  // namespace dpr
