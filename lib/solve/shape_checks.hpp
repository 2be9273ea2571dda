// Checks of what a shape is to be found from, and how.
#pragma once

#include "dpr/shape.hpp"

namespace dpr {

/// These throw InvalidArgument for what a ShapeSolver refuses.
void check_shape_views(const ShapeViews& views);
void check_shape_options(const ShapeOptions& options, const ShapeViews& views);

/// True if a loss compares colours, with any weight.
bool compares_colors(const LossWeights& weights);

}  // namespace dpr
