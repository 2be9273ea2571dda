/// Reference for textures: the value of an image at a place, as a sum over all of its texels, each with the
/// weight that the filter gives it there; the image goes on beyond its borders by the rule of its wrap mode.
///
/// (u, v) has v up: the texel of column c and row r, row 0 on top, has its centre at u = (c + 1/2) / width
/// and v = 1 - (r + 1/2) / height.
#pragma once

#include "vec.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace dpr::reference {

enum class Wrap { repeat, mirror, clamp };
enum class Filter { nearest, bilinear, trilinear };

struct Texture {
  int width = 0;
  int height = 0;
  std::vector<Vec3d> texels;
  Wrap wrap = Wrap::repeat;
  Filter filter = Filter::bilinear;
};

/// The texel that the endless row of texels has at a number, counted from the image's first.
inline int wrapped(long number, int size, Wrap wrap) {
  const auto modulo = [](long a, long n) { return static_cast<int>(((a % n) + n) % n); };
  switch (wrap) {
    case Wrap::repeat:
      return modulo(number, size);
    case Wrap::mirror:
      return std::min(modulo(number, 2L * size), 2 * size - 1 - modulo(number, 2L * size));
    case Wrap::clamp:
      break;
  }
  return static_cast<int>(std::clamp(number, 0L, static_cast<long>(size) - 1));
}

/// Weights of a row's texels at a place, in texels from the image's border, and their derivatives.
struct AxisWeights {
  std::vector<double> weight, slope;
};

inline AxisWeights axis_weights(double place, int size, Wrap wrap, Filter filter) {
  AxisWeights w{std::vector<double>(static_cast<std::size_t>(size)),
                std::vector<double>(static_cast<std::size_t>(size))};
  const auto add = [&](long number, double weight, double slope) {
    const auto texel = static_cast<std::size_t>(wrapped(number, size, wrap));
    w.weight[texel] += weight;
    w.slope[texel] += slope;
  };
  if (filter == Filter::nearest) {
    add(static_cast<long>(std::floor(place)), 1.0, 0.0);
    return w;
  }
  const double below = std::floor(place - 0.5), part = place - 0.5 - below;
  add(static_cast<long>(below), 1.0 - part, -1.0);
  add(static_cast<long>(below) + 1, part, 1.0);
  return w;
}

struct TextureSample {
  Vec3d color;
  Vec3d by_u, by_v;            ///< derivatives
  std::vector<double> weight;  ///< of every texel
};

inline TextureSample sample_texture(const Texture& t, const Vec2d& uv) {
  const AxisWeights x = axis_weights(uv.x * t.width, t.width, t.wrap, t.filter);
  const AxisWeights y = axis_weights((1.0 - uv.y) * t.height, t.height, t.wrap, t.filter);
  TextureSample sample;
  for (std::size_t r = 0; r < y.weight.size(); ++r) {
    for (std::size_t c = 0; c < x.weight.size(); ++c) {
      const Vec3d& texel = t.texels[r * x.weight.size() + c];
      sample.weight.push_back(x.weight[c] * y.weight[r]);
      sample.color += sample.weight.back() * texel;
      sample.by_u += (t.width * x.slope[c] * y.weight[r]) * texel;
      sample.by_v += (-t.height * x.weight[c] * y.slope[r]) * texel;
    }
  }
  return sample;
}

/// The mean colour of a box of a texture's texels, from x0 to x1 and y0 to y1 in texels.
inline Vec3d box_mean(const Texture& t, double x0, double x1, double y0, double y1) {
  Vec3d sum;
  for (int row = 0; row < t.height; ++row) {
    const double high = std::min(y1, row + 1.0) - std::max(y0, static_cast<double>(row));
    for (int column = 0; column < t.width && high > 0.0; ++column) {
      const double wide = std::min(x1, column + 1.0) - std::max(x0, static_cast<double>(column));
      if (wide > 0.0) sum += (wide * high) * t.texels[static_cast<std::size_t>(row * t.width + column)];
    }
  }
  return (1.0 / ((x1 - x0) * (y1 - y0))) * sum;
}

/// The texture with half the texels a side, rounded down, each the mean over its area.
inline Texture shrunk(const Texture& t) {
  Texture small{std::max(t.width / 2, 1), std::max(t.height / 2, 1), {}, t.wrap, t.filter};
  const double wide = static_cast<double>(t.width) / small.width,
               high = static_cast<double>(t.height) / small.height;
  for (int row = 0; row < small.height; ++row) {
    for (int column = 0; column < small.width; ++column)
      small.texels.push_back(box_mean(t, column * wide, (column + 1) * wide, row * high, (row + 1) * high));
  }
  return small;
}

/// Between the levels on both sides of `detail`, 0 being the texture itself.
inline Vec3d sample_pyramid(Texture t, const Vec2d& uv, double detail) {
  while (detail >= 1.0 && (t.width > 1 || t.height > 1)) {
    t = shrunk(t);
    detail -= 1.0;
  }
  const Vec3d here = sample_texture(t, uv).color;
  if (!(detail > 0.0) || (t.width == 1 && t.height == 1)) return here;
  return here + detail * (sample_texture(shrunk(t), uv).color - here);
}

}  // namespace dpr::reference
