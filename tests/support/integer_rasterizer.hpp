// Coverage in whole numbers, without a rounding: which samples a triangle with vertices on a grid of
// fractions of a pixel owns by the top-left rule.
#pragma once

#include <array>
#include <cstdint>

namespace dpr::test {

/// Parts of a pixel that coordinates are counted in. Even, so that pixel centres are whole numbers.
inline constexpr std::int64_t k_subpixels = 16;

/// From the image's centre, in subpixels; x right, y up.
struct GridPoint {
  std::int64_t x = 0, y = 0;
};

using GridTriangle = std::array<GridPoint, 3>;

inline GridPoint sample_of(int column, int row, int width, int height) {
  return {(2 * std::int64_t{column} + 1 - width) * k_subpixels / 2,
          (height - 2 * std::int64_t{row} - 1) * k_subpixels / 2};
}

/// Positive where p lies to the left of a -> b.
inline std::int64_t cross(const GridPoint& a, const GridPoint& b, const GridPoint& p) {
  return (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x);
}

/// A sample on an edge belongs to the triangle whose left or upper edge it is: left edges go down in a
/// counter-clockwise triangle, upper ones to the left.
inline bool owns(const GridTriangle& t, const GridPoint& p) {
  const std::int64_t area = cross(t[0], t[1], t[2]);
  if (area == 0) return false;
  for (std::size_t k = 0; k < 3; ++k) {
    const GridPoint &from = t[k], &to = t[(k + 1) % 3];
    const GridPoint &a = area > 0 ? from : to, &b = area > 0 ? to : from;
    const std::int64_t side = cross(a, b, p);
    const bool is_left_or_upper = b.y < a.y || (b.y == a.y && b.x < a.x);
    if (side < 0 || (side == 0 && !is_left_or_upper)) return false;
  }
  return true;
}

}  // namespace dpr::test
