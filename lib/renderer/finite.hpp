// Checks of single precision's range: the scales of a frame before it is rendered, its gradients after.
#pragma once

#include "dpr/renderer.hpp"

namespace dpr {

/// Throws InvalidArgument where the depth range, or gamma in it, or the lengths that lighting squares are
/// beyond single precision.
void require_scales(const Camera& camera, const Smoothing& smoothing, bool lit);

/// Throws InvalidArgument that names the first gradient that is not finite.
void require_finite(SceneGradient& gradient);

}  // namespace dpr
