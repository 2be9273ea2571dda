// Judgement of a shape by its views.
#pragma once

#include <span>
#include <vector>

#include "dpr/shape.hpp"

namespace dpr {

/// Judges what a shape shows in every view, by ShapeOptions::explained: [view], in the order and size of the views.
std::vector<ViewExplanation> explain_views(const ShapeViews& views, const ShapeOptions& options,
                                           std::span<const Image> shown);

}  // namespace dpr
