// Textures for shading of the caller's own: texels at places, filtered, and their derivatives.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "dpr/export.h"
#include "dpr/texture.hpp"

namespace dpr {

/// Where a texture is read: at any number of places.
struct TexturePlaces {
  /// [place][2] u and v as Texture has them, v up; of cube maps directions [place][3] of any length
  std::span<const float> coordinates{};
  /// [place][coordinate][2], or none: the coordinates' change from sample to sample along x and y, as
  /// interpolate_steps() finds it. The longer axis of the ellipse that a sample covers says which level is read.
  std::span<const float> steps{};
  /// [place], or none: added to the level, the logarithm to base 2 of texels a sample; without steps the level
  std::span<const float> levels{};
};

/// Gradients of <grad, TextureMap::values()>.
struct TextureMapGradient {
  std::vector<float> texels;       ///< [height][width][channel]; of cube maps [6][side][side][channel]
  std::vector<float> coordinates;  ///< as TexturePlaces, and so are these
  std::vector<float> steps, levels;
};

/// A texture of any number of channels, or a cube map. With the filter `trilinear` it has smaller versions of itself,
/// as Texture has, and blends two of them by the level; without steps and levels it reads the first. Works on the host;
/// needs no device. Memory: the texels, and a third with smaller versions.
class DPR_API TextureMap {
 public:
  /// RGB, or RGBA where the texture has opacities.
  explicit TextureMap(const Texture& texture);
  /// texels: [height][width][channel], row 0 on top, where v is 1.
  TextureMap(std::vector<float> texels, int width, int height, Wrap wrap, Filter filter);
  /// texels: [6][side][side][channel], OpenGL's faces +x, -x, +y, -y, +z, -z, row 0 at t = 0. Beyond a face's border
  /// its neighbour goes on.
  static TextureMap cube(std::vector<float> texels, int side, Filter filter);

  std::size_t channels() const { return channels_; }

  /// [place][channel]. O(places channels).
  std::vector<float> values(const TexturePlaces& places) const;
  /// Nearest texels have no gradients by coordinates, steps and levels.
  TextureMapGradient backward(const TexturePlaces& places, std::span<const float> grad_values) const;
  /// Forward mode: [place][channel] derivatives along a direction, by how fast everything changes, of which each may
  /// be left out: the places' numbers, as `places` has them, and the texels, as the constructor has them. The
  /// transpose of backward().
  std::vector<float> tangent(const TexturePlaces& places, const TexturePlaces& place_tangents,
                             std::span<const float> texel_tangents = {}) const;
  // All three throw InvalidArgument for numbers that are not finite, and spans of other sizes.

 private:
  TextureMap(std::vector<float> texels, int width, int height, Wrap wrap, Filter filter, bool is_cube);
  struct Access;

  std::vector<std::vector<float>> levels_;  // [level]: the texels, then those of smaller versions
  int width_, height_;
  std::size_t channels_ = 0;
  Wrap wrap_;
  Filter filter_;
  bool is_cube_;
};

}  // namespace dpr
