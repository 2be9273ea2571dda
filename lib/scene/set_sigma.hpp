// The scale of the distance noise, and what follows it.
#pragma once

#include "dpr/smoothing.hpp"

namespace dpr {

/// Sets sigma; a blur radius, where one is given, stays the same number of sigmas.
inline void set_sigma(Smoothing& smoothing, float sigma) {
  if (smoothing.blur_radius) *smoothing.blur_radius *= sigma / smoothing.sigma;
  smoothing.sigma = sigma;
}

}  // namespace dpr
