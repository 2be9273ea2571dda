// Texels at places of a texture or a cube map, of any number of channels: in the caller's memory, unchecked.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "dpr/texture_map.hpp"

namespace dpr {

/// Texels beyond the first and last: as Wrap has them, in its order, zeros, or those of the cube's next face.
enum class Border { repeat, mirror, clamp, zero, cube };

struct TextureLookup {
  struct Level {
    std::span<const float> texels;  ///< [height][width][channel]; of cube maps six of them
    int width, height;
  };
  std::vector<Level>
      levels;  ///< the texture, and smaller versions; the first alone unless the filter is trilinear
  std::size_t channels;
  Border border;
  Filter filter;
  bool is_v_up;                   ///< otherwise v is 0 at row 0
  bool is_level_rounded = false;  ///< one version is read, and not two blended

  std::size_t dimensions() const { return border == Border::cube ? 3 : 2; }
  std::size_t count(const TexturePlaces& places) const { return places.coordinates.size() / dimensions(); }
};

/// Of everything that is to have one, to be added to.
struct LookupGradients {
  std::vector<std::span<float>> texels{};  ///< as TextureLookup::levels, or none
  std::span<float> coordinates{}, steps{}, levels{};
};

/// To values [place][channel].
void look_up(const TextureLookup& texture, const TexturePlaces& places, std::span<float> values);
void look_up_backward(const TextureLookup& texture, const TexturePlaces& places,
                      std::span<const float> grad_values, const LookupGradients& gradients);
/// `moving`: tangents, each of which may be left out; of texels by level.
void look_up_tangent(const TextureLookup& texture, const TexturePlaces& places, const TexturePlaces& moving,
                     std::span<const std::span<const float>> moving_texels, std::span<float> tangents);

}  // namespace dpr
