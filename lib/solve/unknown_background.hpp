// What a picture says of where the object is, if nothing is known of what lies behind it.
#pragma once

#include <optional>

#include "dpr/image.hpp"
#include "dpr/pose.hpp"

namespace dpr {

/// Coverage that each pixel should have, in the first channel of an image of that size, and in alpha how much that
/// counts: but for a constant a (1 - c)^2 + b c^2 of the coverage c. Without a box all pixels should be covered.
///
/// With one those in it should, or close to it, since boxes are not exact; the less so, the more their colours are
/// those beside the box. p being the probability that a pixel shows what lies in the box and not what lies beside it,
/// by histograms of both, as much one as the other beforehand: a = sqrt(2 p) in the box, 0 beside it; b = 2 (1 - 2 p)
/// where p is below a half, and 1 more beside the box. `mask`: weights of pixels; empty: 1.
Image coverage_before_unknown(const Image& target, const Image& mask, const std::optional<PoseBox>& box,
                              int width, int height);

}  // namespace dpr
