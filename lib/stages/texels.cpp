#include "stages/texels.hpp"

#include <algorithm>

namespace dpr {

namespace {

/// Texels of a level of a pyramid (kernels/pyramid.h).
std::size_t texels_of_level(const shared::Texture& texture, cl_uint level) {
  return std::size_t{std::max(texture.width >> level, 1U)} * std::max(texture.height >> level, 1U);
}

}  // namespace

Texels::Texels(Device::Impl& device)
    : device_(device),
      sort_(device),
      sum_(device, "texels.cl", "texels_sum"),
      gather_(device, "texels.cl", "texels_gather"),
      shrink_(device, "texels.cl", "texels_shrink"),
      shrink_backward_(device, "texels.cl", "texels_shrink_backward") {}

void Texels::build(Textures& textures) {
  for (cl_uint i = 0; i < textures.list.size(); ++i) {
    const shared::Texture& t = textures.list[i];
    for (cl_uint level = 1; level < t.levels; ++level)
      shrink_(texels_of_level(t, level), i, level, textures.textures, textures.texel_values);
  }
}

void Texels::start(const Textures& textures) {
  sums_.resize(device_, 4 * textures.texels);
  sums_.fill(cl_float4{});
}

void Texels::add(const Textures& textures, Surface& surface) {
  const std::size_t places = surface.cells.size();
  if (places == 0) return;
  sort_(places, surface.place_count, textures.texels + 1, surface.cells, surface.numbers, starts_);
  sum_(textures.texels, static_cast<cl_uint>(textures.texels), starts_, surface.numbers, surface.parts,
       surface.grad_seen, sums_);
}

void Texels::finish(const Textures& textures) {
  grad.resize(device_, textures.texels);
  const auto cells = static_cast<cl_uint>(textures.texels);
  for (cl_uint i = 0; i < textures.list.size(); ++i) {
    const shared::Texture& t = textures.list[i];
    for (cl_uint level = t.levels; level-- > 0;) {
      gather_(texels_of_level(t, level), cells, i, level, textures.textures, sums_, grad);
      if (level + 1 < t.levels)
        shrink_backward_(texels_of_level(t, level), i, level + 1, textures.textures, grad);
    }
  }
}

std::size_t Texels::bytes() const {
  return grad.capacity_bytes() + sort_.bytes() + starts_.capacity_bytes() + sums_.capacity_bytes();
}

}  // namespace dpr
