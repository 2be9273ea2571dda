#include "dpr/texture_map.hpp"

#include <string>
#include <utility>

#include "base/checks.hpp"
#include "image/texture_lookup.hpp"
#include "image/texture_pyramid.hpp"
#include "image/texture_words.hpp"

namespace dpr {
namespace {

std::vector<float> texels_of(const Texture& texture) {
  validate(texture);
  std::vector<float> texels;
  for (std::size_t i = 0; i < texture.texels.size(); ++i) {
    for (int c = 0; c < 3; ++c) texels.push_back(texture.texels[i][c]);
    if (!texture.opacities.empty()) texels.push_back(texture.opacities[i]);
  }
  return texels;
}

/// As many finite numbers, or none.
void require_or_none(std::span<const float> numbers, std::size_t count, const char* name) {
  if (!numbers.empty()) checks::require_numbers(numbers, count, checks::in(name, "texture map"));
}

}  // namespace

struct TextureMap::Access {
  TexturePyramid pyramid;
  TextureLookup lookup;

  explicit Access(const TextureMap& map)
      : pyramid(map.width_, map.height_, map.is_cube_ ? 6 : 1, map.channels_,
                map.filter_ == Filter::trilinear),
        lookup{{},
               map.channels_,
               map.is_cube_ ? Border::cube : static_cast<Border>(map.wrap_),
               map.filter_,
               !map.is_cube_} {
    for (std::size_t level = 0; level < map.levels_.size(); ++level)
      lookup.levels.push_back(
          {map.levels_[level], pyramid.sizes()[level].width, pyramid.sizes()[level].height});
  }

  /// Their number.
  std::size_t require_places(const TexturePlaces& places) const {
    const std::size_t size = lookup.dimensions(), count = lookup.count(places);
    require_or_none(places.coordinates, count * size, "coordinates");
    require_or_none(places.steps, 2 * size * count, "steps");
    require_or_none(places.levels, count, "levels");
    return count;
  }
};

TextureMap::TextureMap(const Texture& texture)
    : TextureMap(texels_of(texture), texture.width, texture.height, texture.wrap, texture.filter) {}

TextureMap::TextureMap(std::vector<float> texels, int width, int height, Wrap wrap, Filter filter)
    : TextureMap(std::move(texels), width, height, wrap, filter, false) {}

TextureMap TextureMap::cube(std::vector<float> texels, int side, Filter filter) {
  return {std::move(texels), side, side, Wrap::clamp, filter, true};
}

TextureMap::TextureMap(std::vector<float> texels, int width, int height, Wrap wrap, Filter filter,
                       bool is_cube)
    : width_(width), height_(height), wrap_(wrap), filter_(filter), is_cube_(is_cube) {
  require_form(width, height, wrap, filter, "texture map");
  const std::size_t count =
      (is_cube ? 6 : 1) * static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  channels_ = texels.size() / count;
  if (texels.empty() || texels.size() % count != 0)
    throw InvalidArgument("texels (texture map)", std::to_string(texels.size()) + " numbers",
                          "a multiple of " + std::to_string(count) + ", the texels");
  require_or_none(texels, texels.size(), "texels");
  levels_ = Access(*this).pyramid.smaller(texels);
  levels_.insert(levels_.begin(), std::move(texels));
}

std::vector<float> TextureMap::values(const TexturePlaces& places) const {
  const Access access(*this);
  std::vector<float> values(channels_ * access.require_places(places));
  look_up(access.lookup, places, values);
  return values;
}

TextureMapGradient TextureMap::backward(const TexturePlaces& places,
                                        std::span<const float> grad_values) const {
  const Access access(*this);
  const std::size_t count = access.require_places(places);
  checks::require_numbers(grad_values, channels_ * count, "grad_values (texture map)");
  TextureMapGradient found{{},
                           std::vector<float>(places.coordinates.size()),
                           std::vector<float>(places.steps.size()),
                           std::vector<float>(places.levels.size())};
  std::vector<std::vector<float>> by_level;
  for (const std::vector<float>& level : levels_) by_level.emplace_back(level.size());
  const std::vector<std::span<float>> levels(by_level.begin(), by_level.end());
  look_up_backward(access.lookup, places, grad_values,
                   {levels, found.coordinates, found.steps, found.levels});
  access.pyramid.gather(levels);
  found.texels = std::move(by_level[0]);
  return found;
}

std::vector<float> TextureMap::tangent(const TexturePlaces& places, const TexturePlaces& place_tangents,
                                       std::span<const float> texel_tangents) const {
  const Access access(*this);
  std::vector<float> tangents(channels_ * access.require_places(places));
  require_or_none(place_tangents.coordinates, places.coordinates.size(), "coordinate tangents");
  require_or_none(place_tangents.steps, places.steps.size(), "step tangents");
  require_or_none(place_tangents.levels, places.levels.size(), "level tangents");
  require_or_none(texel_tangents, levels_[0].size(), "texel tangents");
  std::vector<std::span<const float>> moving_texels;
  std::vector<std::vector<float>> of_smaller;
  if (!texel_tangents.empty()) {
    of_smaller = access.pyramid.smaller(texel_tangents);
    moving_texels.push_back(texel_tangents);
    moving_texels.insert(moving_texels.end(), of_smaller.begin(), of_smaller.end());
  }
  look_up_tangent(access.lookup, places, place_tangents, moving_texels, tangents);
  return tangents;
}

}  // namespace dpr
