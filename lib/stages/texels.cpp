#include "stages/texels.hpp"

#include <algorithm>

namespace dpr {

namespace {

/// Texels of a level of a pyramid (kernels/pyramid.h).
std::size_t texels_of_level(const shared::Texture& texture, cl_uint level) {
  return std::size_t{std::max(texture.width >> level, 1U)} * std::max(texture.height >> level, 1U);
}

}  // namespace

void Texels::build(Textures& textures) {
  for (cl_uint i = 0; i < textures.list.size(); ++i) {
    const shared::Texture& t = textures.list[i];
    for (cl_uint level = 1; level < t.levels; ++level)
      launch_(
          texels_of_level(t, level),
          kernel::texels_shrink{
              .number = i, .level = level, .textures = textures.textures, .texels = textures.texel_values});
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
  for (cl_uint i = 0; i < textures.list.size(); ++i) {
    const shared::Texture& t = textures.list[i];
    for (cl_uint level = 0; level < t.levels; ++level)
      launch_(texels_of_level(t, level), kernel::texels_sum{.number = i,
                                                            .level = level,
                                                            .textures = textures.textures,
                                                            .starts = starts_,
                                                            .numbers = surface.numbers,
                                                            .places = surface.seen,
                                                            .grad = grad});
  }
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

std::size_t Texels::bytes() const { return grad.capacity_bytes() + sort_.bytes() + starts_.capacity_bytes(); }

}  // namespace dpr
