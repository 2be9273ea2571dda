// The texels that a place of a texture is a mixture of: their numbers, and their weights with derivatives.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <type_traits>
#include <unsupported/Eigen/AutoDiff>

#include "image/texture_lookup.hpp"

namespace dpr::taps {

/// A number with its derivatives by so many inputs.
template <int Inputs>
using Derived = Eigen::AutoDiffScalar<Eigen::Array<float, Inputs, 1>>;

inline float value_of(float number) { return number; }
template <int Inputs>
float value_of(const Derived<Inputs>& number) {
  return number.value();
}

template <class T>
T bounded(const T& number, float least, float most) {
  return value_of(number) < least ? T(least) : value_of(number) > most ? T(most) : number;
}

/// A place on an image or on a face of a cube: column and row as parts of the width and height, and how these change
/// from pixel to pixel along x and y.
template <class T>
struct OnImage {
  std::size_t face = 0;
  std::array<T, 2> at;
  std::array<std::array<T, 2>, 2> steps;
};

/// Where a direction meets the cube, by OpenGL's table of cube maps.
template <class T>
OnImage<T> on_cube(const std::array<T, 3>& direction, const std::array<std::array<T, 2>, 3>& steps) {
  constexpr std::array<std::array<std::size_t, 3>, 3> k_axes{{{2, 1, 0}, {0, 2, 1}, {0, 1, 2}}};
  const float x = std::fabs(value_of(direction[0])), y = std::fabs(value_of(direction[1])),
              z = std::fabs(value_of(direction[2]));
  const std::size_t axis = z > std::max(x, y) ? 2 : y > x ? 1 : 0;
  const float sign = value_of(direction[axis]) < 0 ? -1.0F : 1.0F;
  const std::array<std::array<float, 3>, 3> signs{{{-sign, -1, sign}, {1, sign, sign}, {sign, -1, sign}}};
  // The largest coordinate becomes 1 or -1: the square of any length may be no number.
  constexpr float k_most = 1e37F;
  const float size = std::fabs(value_of(direction[axis])), scale = size > 0 ? std::min(1 / size, k_most) : 1;
  const auto turned = [&](const auto& of, std::size_t i) {
    return T(of(k_axes[axis][i]) * (signs[axis][i] * scale));
  };
  const auto number = [&](std::size_t i) { return direction[i]; };
  const T depth = value_of(direction[axis]) == 0 ? T(1) : turned(number, 2);
  OnImage<T> place;
  place.face = 2 * axis + (sign < 0 ? 1 : 0);
  for (std::size_t i = 0; i < 2; ++i) {
    const T on_face = turned(number, i) / depth;
    place.at[i] = on_face * 0.5F + 0.5F;
    for (std::size_t k = 0; k < 2; ++k) {
      const auto step = [&](std::size_t j) { return steps[j][k]; };
      place.steps[i][k] = (turned(step, i) - on_face * turned(step, 2)) * 0.5F / depth;
    }
  }
  return place;
}

/// The direction at parts (s, t) of a face's width and height.
inline std::array<float, 3> direction_of(std::size_t face, float s, float t) {
  const float x = 2 * s - 1, y = 2 * t - 1;
  const std::array<std::array<float, 3>, 6> directions{
      {{1, -y, -x}, {-1, -y, x}, {x, 1, y}, {x, -1, -y}, {x, -y, 1}, {-x, -y, -1}}};
  return directions[face];
}

template <class T>
struct Tap {
  std::size_t level, texel;
  T weight;
};

/// The texels of a place: at most six of each of two levels, as three make the corner that faces of a cube share.
template <class T>
class Taps {
 public:
  void add(std::size_t level, std::size_t texel, const T& weight) { all_[count_++] = {level, texel, weight}; }
  auto begin() const { return all_.begin(); }
  auto end() const { return all_.begin() + count_; }

 private:
  std::array<Tap<T>, 12> all_;  // of which `count_` are set
  std::ptrdiff_t count_ = 0;
};

/// A texel, or what stands for it beyond the borders.
template <class T>
void add_texel(const TextureLookup& texture, std::size_t level, std::size_t face, int column, int row,
               const T& weight, Taps<T>& to) {
  const TextureLookup::Level& image = texture.levels[level];
  const int right = image.width - 1, bottom = image.height - 1;
  const auto add = [&](std::size_t of_face, int c, int r) {
    to.add(level,
           (of_face * static_cast<std::size_t>(image.height) + static_cast<std::size_t>(r)) *
                   static_cast<std::size_t>(image.width) +
               static_cast<std::size_t>(c),
           weight);
  };
  const int nearest_column = std::clamp(column, 0, right), nearest_row = std::clamp(row, 0, bottom);
  const bool is_beside = column != nearest_column, is_above = row != nearest_row;
  if (!is_beside && !is_above) return add(face, column, row);
  switch (texture.border) {
    case Border::repeat:
      return add(face, is_beside ? right - nearest_column : column, is_above ? bottom - nearest_row : row);
    case Border::mirror:
    case Border::clamp:
      return add(face, nearest_column, nearest_row);
    case Border::zero:
      return;
    case Border::cube:
      break;
  }
  if (is_beside && is_above) {
    const T third = weight * (1.0F / 3);
    add_texel(texture, level, face, column, nearest_row, third, to);
    add_texel(texture, level, face, nearest_column, row, third, to);
    add_texel(texture, level, face, nearest_column, nearest_row, third, to);
    return;
  }
  const auto size = static_cast<float>(image.width);
  const OnImage<float> there = on_cube<float>(
      direction_of(face, (static_cast<float>(column) + 0.5F) / size, (static_cast<float>(row) + 0.5F) / size),
      {});
  add(there.face, std::clamp(static_cast<int>(there.at[0] * size), 0, right),
      std::clamp(static_cast<int>(there.at[1] * size), 0, bottom));
}

/// Of one level, times `part`.
template <class T>
void add_level(const TextureLookup& texture, std::size_t level, const OnImage<T>& place, const T& part,
               Taps<T>& to) {
  const TextureLookup::Level& image = texture.levels[level];
  const float half = texture.filter == Filter::nearest ? 0.0F : 0.5F;
  const T x = place.at[0] * static_cast<float>(image.width) - half,
          y = place.at[1] * static_cast<float>(image.height) - half;
  const auto column = static_cast<int>(std::floor(value_of(x))),
             row = static_cast<int>(std::floor(value_of(y)));
  if (texture.filter == Filter::nearest) {
    const bool is_cube = texture.border == Border::cube;
    return add_texel(texture, level, place.face, is_cube ? std::min(column, image.width - 1) : column,
                     is_cube ? std::min(row, image.height - 1) : row, part, to);
  }
  const T right = x - static_cast<float>(column), down = y - static_cast<float>(row);
  const T left = 1.0F - right, up = 1.0F - down;
  if (column >= 0 && row >= 0 && column + 1 < image.width && row + 1 < image.height) {
    const auto width = static_cast<std::size_t>(image.width);
    const std::size_t first =
        (place.face * static_cast<std::size_t>(image.height) + static_cast<std::size_t>(row)) * width +
        static_cast<std::size_t>(column);
    to.add(level, first, T(left * up * part));
    to.add(level, first + 1, T(right * up * part));
    to.add(level, first + width, T(left * down * part));
    to.add(level, first + width + 1, T(right * down * part));
    return;
  }
  add_texel(texture, level, place.face, column, row, T(left * up * part), to);
  add_texel(texture, level, place.face, column + 1, row, T(right * up * part), to);
  add_texel(texture, level, place.face, column, row + 1, T(left * down * part), to);
  add_texel(texture, level, place.face, column + 1, row + 1, T(right * down * part), to);
}

/// The logarithm to base 2 of the texels along the longer axis of the ellipse that a pixel covers.
template <class T>
T level_of(const TextureLookup& texture, const OnImage<T>& place) {
  constexpr float k_least_area = 1e-12F, k_most = 1e9F;  // texels, whose fourth power is a number
  const TextureLookup::Level& image = texture.levels[0];
  const std::array<float, 2> size{static_cast<float>(image.width), static_cast<float>(image.height)};
  std::array<std::array<T, 2>, 2> step;  // [along x or y][coordinate]
  for (std::size_t k = 0; k < 2; ++k)
    for (std::size_t i = 0; i < 2; ++i) step[k][i] = bounded(T(place.steps[i][k] * size[i]), -k_most, k_most);
  const auto product = [&](std::size_t k, std::size_t m) {
    return T(step[k][0] * step[m][0] + step[k][1] * step[m][1]);
  };
  const T a = product(0, 0), b = product(1, 1), c = product(0, 1);
  const T half_difference = (a - b) * 0.5F;
  const T root2 = half_difference * half_difference + c * c;
  using std::log;
  using std::sqrt;
  const T root = sqrt(T(bounded(root2, k_least_area * k_least_area, INFINITY)));
  return T(log(T(bounded(T((a + b) * 0.5F + root), k_least_area, INFINITY)))) * (0.5F / std::log(2.0F));
}

/// A coordinate between 0 and 1, or as far beyond as borders tell.
template <class T>
T within(const T& number, Border border) {
  if (border == Border::repeat) return number - std::floor(value_of(number));
  if (border == Border::mirror) {
    const T folded = number - 2 * std::floor(0.5F * value_of(number));
    return value_of(folded) > 1 ? T(2.0F - folded) : folded;
  }
  return border == Border::zero ? bounded(number, -2, 3) : bounded(number, 0, 1);
}

/// What is read at a place beside its coordinates.
struct Reads {
  bool steps, levels;
};

/// inputs: number i of the coordinates, then of their steps, then what is added to the level. Without levels there are
/// coordinates alone.
template <int Dimensions, bool HasLevels, class T, class Inputs>
Taps<T> taps_of(const TextureLookup& texture, const Reads& reads, const Inputs& inputs) {
  std::array<T, Dimensions> at;
  std::array<std::array<T, 2>, Dimensions> steps;
  for (int i = 0; i < Dimensions; ++i) {
    const auto row = static_cast<std::size_t>(i);
    at[row] = inputs(i);
    steps[row].fill(T(0));
    if constexpr (HasLevels) {
      for (int k = 0; k < 2; ++k) steps[row][static_cast<std::size_t>(k)] = inputs(Dimensions + 2 * i + k);
    }
  }
  OnImage<T> place;
  if constexpr (Dimensions == 3) {
    place = on_cube(at, steps);
  } else {
    if (texture.is_v_up) at[1] = T(1.0F - at[1]);
    place.at = at;
    place.steps = steps;
  }
  for (T& number : place.at) number = within(number, texture.border);
  Taps<T> found;
  if constexpr (HasLevels) {
    const std::size_t last = texture.levels.size() - 1;
    T level = reads.steps ? level_of(texture, place) : T(0);
    if (reads.levels) level = T(level + inputs(3 * Dimensions));
    if (texture.is_level_rounded) level = T(std::floor(value_of(level) + 0.5F));
    level = bounded(level, 0, static_cast<float>(last));
    const std::size_t lower = std::min(static_cast<std::size_t>(value_of(level)), last - 1);
    const T part = level - static_cast<float>(lower);
    add_level(texture, lower, place, T(1.0F - part), found);
    if constexpr (std::is_same_v<T, float>) {
      if (part == 0) return found;
    }
    add_level(texture, lower + 1, place, part, found);
  } else {
    add_level(texture, 0, place, T(1), found);
  }
  return found;
}

}  // namespace dpr::taps
