// The derivative that adaptive smoothing watches.
#pragma once

#include "dpr/renderer.hpp"

namespace dpr {

/// d loss / d gamma, as published. With noise on the pixel d loss / d sigma: there the depths' noise changes
/// nothing where faces do not overlap, as those that a closed shape shows.
inline double by_smoothing(const Smoothing& smoothing, const SceneGradient& gradient) {
  return smoothing.noise == Noise::pixel ? gradient.sigma : gradient.gamma;
}

}  // namespace dpr
