// Pictures of what differs between images.
#pragma once

#include <string>
#include <vector>

#include "dpr/image.hpp"

namespace dpr::cli {

/// |a - b| of pairs of images, all as many times as bright as shows something.
struct Differences {
  std::vector<Image> images;
  int gain = 1;

  /// "difference, 8 times as bright".
  std::string caption() const;
};

/// Images of one size by pairs, as many `a` as `b`. The gain is the largest power of two, up to 8, that
/// leaves 99% of the pixels that differ below 1.
Differences differences(const std::vector<Image>& a, const std::vector<Image>& b);

}  // namespace dpr::cli
