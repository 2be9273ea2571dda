// The gradient of a batch from those of its chunks.
#pragma once

#include <vector>

#include "dpr/renderer.hpp"

namespace dpr {

/// Sums over views are added in the order of the chunks, in double precision; what is one view's comes one
/// after the other. A single chunk's is that chunk's. At least one.
SceneGradient sum_of(std::vector<SceneGradient>&& chunks);

}  // namespace dpr
