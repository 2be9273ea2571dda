#include "solve/unknown_background.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "solve/resample.hpp"

namespace dpr {
namespace {

/// How often colours are seen: by the square roots of channels, which spread dark ones as sRGB does.
class ColorHistogram {
 public:
  void add(const glm::vec4& color, float weight) {
    counts_[index(bins_of(color))] += double{weight};
    total_ += double{weight};
  }

  /// Spreads each bin's count over itself and its neighbours along an axis, one axis after the other.
  void smooth() {
    for (int axis = 0; axis < 3; ++axis) {
      const std::vector<double> before = counts_;
      for (std::size_t i = 0; i < before.size(); ++i) {
        const glm::ivec3 bins = bins_of(i);
        glm::ivec3 low = bins, high = bins;
        low[axis] = std::max(bins[axis] - 1, 0);
        high[axis] = std::min(bins[axis] + 1, k_bins - 1);
        counts_[i] = before[i] / 2 + (before[index(low)] + before[index(high)]) / 4;
      }
    }
  }

  bool is_empty() const { return !(total_ > 0); }
  /// Part of the pixels that have the colour, or nearly. A colour that is not seen may be.
  double share(const glm::vec4& color) const {
    constexpr double k_unseen = 1e-4;
    return counts_[index(bins_of(color))] / total_ + k_unseen;
  }

 private:
  static constexpr int k_bins = 16;  // a channel

  static std::size_t index(const glm::ivec3& bins) {
    return static_cast<std::size_t>((bins.x * k_bins + bins.y) * k_bins + bins.z);
  }
  static glm::ivec3 bins_of(std::size_t index) {
    const auto i = static_cast<int>(index);
    return {i / (k_bins * k_bins), i / k_bins % k_bins, i % k_bins};
  }
  static glm::ivec3 bins_of(const glm::vec4& color) {
    const glm::vec3 spread = glm::sqrt(glm::clamp(glm::vec3(color), 0.0F, 1.0F));
    return glm::min(glm::ivec3(spread * static_cast<float>(k_bins)), k_bins - 1);
  }

  std::vector<double> counts_ = std::vector<double>(std::size_t{k_bins} * k_bins * k_bins);
  double total_ = 0;
};

/// Part of every pixel, in the first channel of an image of the target's size, that lies in a box which is wider by so
/// much on every side.
Image within(const PoseBox& box, float margin, const Image& target) {
  Image image(target.width, target.height);
  const glm::vec2 low = glm::vec2(box.x, box.y) - margin,
                  high = glm::vec2(box.x + box.width, box.y + box.height) + margin;
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      const glm::vec2 at(column, row);
      const glm::vec2 shared = glm::clamp(glm::min(at + 1.0F, high) - glm::max(at, low), 0.0F, 1.0F);
      image.at(column, row).x = shared.x * shared.y;
    }
  }
  return image;
}

/// p, in the first channel of an image of the target's size: a half where colours are seen in neither part, and all
/// over where one of the two is empty.
Image object_probability(const Image& target, const Image& mask, const PoseBox& box) {
  const Image inside = within(box, 0, target);
  ColorHistogram in_box, beside;
  for (std::size_t i = 0; i < target.pixels.size(); ++i) {
    const float weight = mask.pixels.empty() ? 1 : mask.pixels[i].x;
    in_box.add(target.pixels[i], weight * inside.pixels[i].x);
    beside.add(target.pixels[i], weight * (1 - inside.pixels[i].x));
  }
  Image probability(target.width, target.height, glm::vec4(0.5F));
  if (in_box.is_empty() || beside.is_empty()) return probability;
  in_box.smooth();
  beside.smooth();
  for (std::size_t i = 0; i < target.pixels.size(); ++i) {
    const double here = in_box.share(target.pixels[i]);
    probability.pixels[i].x = static_cast<float>(here / (here + beside.share(target.pixels[i])));
  }
  return probability;
}

}  // namespace

Image coverage_before_unknown(const Image& target, const Image& mask, const std::optional<PoseBox>& box,
                              int width, int height) {
  constexpr float k_slack = 0.03F;  // of the box's larger side
  constexpr float k_beside = 2;     // b of a colour that is seen beside the box alone
  if (!box) return {width, height, glm::vec4(1)};
  Image coverage = resample(within(*box, k_slack * std::max(box->width, box->height), target), width, height);
  const Image probability = resample(object_probability(target, mask, *box), width, height);
  for (std::size_t i = 0; i < coverage.pixels.size(); ++i) {
    const float part = coverage.pixels[i].x, twice = 2 * probability.pixels[i].x;
    const float a = part * std::sqrt(twice), b = 1 - part + k_beside * std::max(0.0F, 1 - twice);
    coverage.pixels[i] = glm::vec4(glm::vec3(a / (a + b)), a + b);
  }
  return coverage;
}

}  // namespace dpr
