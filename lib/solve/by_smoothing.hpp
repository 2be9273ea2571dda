// The derivative that adaptive smoothing watches.
#pragma once

#include "dpr/renderer.hpp"

namespace dpr {

/// d loss / d gamma, as published. With noise on the pixel d loss / d sigma: the faces that a closed shape
/// shows do not overlap, and no noise of depths changes anything where that of triangles does not mix them.
inline double by_smoothing(const Smoothing& smoothing, const SceneGradient& gradient) {
  return smoothing.noise == Noise::pixel ? gradient.sigma : gradient.gamma;
}

}  // namespace dpr
