// The scale of the distance noise, and what follows it.
#pragma once

#include "dpr/smoothing.hpp"

namespace dpr {

/// Sets sigma; a blur radius, where one is given, stays the same number of sigmas. With a variable width it
/// stays as it is: there sigma is no width, but what keeps the derivative at an edge finite.
inline void set_sigma(Smoothing& smoothing, float sigma) {
  const bool is_width = smoothing.occupancy_width == OccupancyWidth::fixed;
  if (smoothing.blur_radius && is_width) *smoothing.blur_radius *= sigma / smoothing.sigma;
  smoothing.sigma = sigma;
}

}  // namespace dpr
