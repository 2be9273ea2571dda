#include "solve/extent.hpp"

#include <algorithm>
#include <glm/gtx/component_wise.hpp>
#include <iterator>
#include <limits>
#include <utility>
#include <vector>

#include "solve/median.hpp"

namespace dpr {
namespace {

/// How much the means over 3x3 pixels differ from a colour, in the first channel.
Image difference_from(const Image& image, const glm::vec3& color) {
  Image result(image.width, image.height);
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      glm::vec3 sum(0.0F);
      for (int i = 0; i < 9; ++i) {
        const int x = std::clamp(column + i % 3 - 1, 0, image.width - 1),
                  y = std::clamp(row + i / 3 - 1, 0, image.height - 1);
        sum += glm::vec3(image.at(x, y));
      }
      result.at(column, row).x = glm::compMax(glm::abs(sum / 9.0F - color));
    }
  }
  return result;
}

/// Columns and rows that a set of pixels spans.
struct Span {
  glm::ivec2 low{std::numeric_limits<int>::max()}, high{0};
  std::size_t pixels = 0;

  void add(const glm::ivec2& pixel) {
    low = glm::min(low, pixel);
    high = glm::max(high, pixel + 1);
    ++pixels;
  }
  PoseBox box() const {
    const glm::vec2 corner(low), size(high - low);
    return {corner.x, corner.y, size.x, size.y};
  }
};

/// Connected sets of the pixels whose first channel is above a bound.
std::vector<Span> components_above(const Image& image, float bound) {
  std::vector<char> is_left(image.pixels.size());
  std::ranges::transform(image.pixels, is_left.begin(), [&](const glm::vec4& p) { return p.x > bound; });
  std::vector<Span> components;
  std::vector<glm::ivec2> open;
  const auto take = [&](const glm::ivec2& at) {
    if (at.x < 0 || at.y < 0 || at.x >= image.width || at.y >= image.height) return false;
    return std::exchange(is_left[static_cast<std::size_t>(at.y) * static_cast<std::size_t>(image.width) +
                                 static_cast<std::size_t>(at.x)],
                         char{0}) != 0;
  };
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      if (!take({column, row})) continue;
      Span& component = components.emplace_back();
      for (open = {{column, row}}; !open.empty();) {
        const glm::ivec2 at = open.back();
        open.pop_back();
        component.add(at);
        for (int i = 0; i < 9; ++i)
          if (const glm::ivec2 next = at + glm::ivec2(i % 3 - 1, i / 3 - 1); take(next)) open.push_back(next);
      }
    }
  }
  return components;
}

}  // namespace

std::optional<PoseBox> extent(const Image& weights) {
  float largest = 0;
  for (const glm::vec4& pixel : weights.pixels) largest = std::max(largest, pixel.x);
  Span span;
  for (int row = 0; row < weights.height; ++row) {
    for (int column = 0; column < weights.width; ++column)
      if (weights.at(column, row).x > 0.5F * largest) span.add({column, row});
  }
  return span.pixels > 0 ? std::optional(span.box()) : std::nullopt;
}

std::optional<PoseBox> extent_before(const Image& target, const glm::vec3& background) {
  constexpr float k_deviations = 5, k_to_deviation = 1.4826F;  // of a normal distribution, from its median
  constexpr float k_least = 0.02F;                             // which JPEG makes of nothing
  constexpr std::size_t k_part = 10;  // of the largest component: smaller ones are specks
  const Image difference = difference_from(target, background);
  std::vector<float> sizes;
  for (const glm::vec4& pixel : difference.pixels) sizes.push_back(pixel.x);
  const float usual = median(sizes);
  for (float& size : sizes) size = std::abs(size - usual);
  const float deviation = k_to_deviation * median(std::move(sizes));
  const std::vector<Span> components =
      components_above(difference, usual + std::max(k_least, k_deviations * deviation));
  if (components.empty()) return {};
  const std::size_t most = std::ranges::max_element(components, {}, &Span::pixels)->pixels;
  Span all;
  for (const Span& component : components) {
    if (k_part * component.pixels < most) continue;
    all.low = glm::min(all.low, component.low);
    all.high = glm::max(all.high, component.high);
  }
  return all.box();
}

}  // namespace dpr
