// Ever smaller versions of a texture: half the texels a side, rounded down, each the mean over its area.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace dpr {

/// Of `images` images of one size, one after the other, with any number of channels.
class TexturePyramid {
 public:
  struct Size {
    int width, height;
  };

  TexturePyramid(int width, int height, std::size_t images, std::size_t channels, bool has_smaller);

  /// The texture's, then those of smaller versions, if it has them, down to a single texel.
  const std::vector<Size>& sizes() const { return sizes_; }
  /// How many numbers a version has.
  std::size_t count(std::size_t level) const;
  /// The smaller versions of these texels.
  std::vector<std::vector<float>> smaller(std::span<const float> texels) const;
  /// The transpose: adds gradients of each version, [level], to those of the next larger one.
  void gather(std::span<const std::span<float>> gradients) const;

 private:
  template <class Function>
  void for_each_mean(std::size_t level, const Function& function) const;

  std::size_t images_, channels_;
  std::vector<Size> sizes_;
};

}  // namespace dpr
