// Pictures put together for reports.
#pragma once

#include <vector>

#include "dpr/image.hpp"

namespace dpr::cli {

/// Rows below each other, with a gap between them. All must have the same width; at least one.
Image vstack(const std::vector<Image>& rows, int gap = 2);

}  // namespace dpr::cli
