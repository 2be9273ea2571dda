#include "image/texture_pyramid.hpp"

#include <algorithm>
#include <array>

namespace dpr {
namespace {

/// The texels of a row that the next smaller version's texel is the mean of: at most four, as a row shrinks to a half
/// or a third.
struct Mean {
  std::size_t first;
  std::array<float, 4> weights;
};

std::vector<Mean> means_of(int from, int to) {
  const double width = static_cast<double>(from) / to;
  std::vector<Mean> means;
  for (int i = 0; i < to; ++i) {
    const double begin = i * width, end = begin + width;
    Mean mean{static_cast<std::size_t>(begin), {}};
    for (std::size_t k = 0; k < mean.weights.size(); ++k) {
      const double least = std::max(begin, static_cast<double>(mean.first + k)),
                   most = std::min(end, static_cast<double>(mean.first + k) + 1);
      mean.weights[k] = static_cast<float>(std::max(most - least, 0.0) / width);
    }
    means.push_back(mean);
  }
  return means;
}

}  // namespace

TexturePyramid::TexturePyramid(int width, int height, std::size_t images, std::size_t channels,
                               bool has_smaller)
    : images_(images), channels_(channels), sizes_{{width, height}} {
  while (has_smaller && std::max(sizes_.back().width, sizes_.back().height) > 1)
    sizes_.push_back({std::max(sizes_.back().width / 2, 1), std::max(sizes_.back().height / 2, 1)});
}

std::size_t TexturePyramid::count(std::size_t level) const {
  return images_ * channels_ * static_cast<std::size_t>(sizes_[level].width) *
         static_cast<std::size_t>(sizes_[level].height);
}

/// Calls a function with every number of a version, one of the larger version that is part of it, and its weight.
template <class Function>
void TexturePyramid::for_each_mean(std::size_t level, const Function& function) const {
  const Size &large = sizes_[level - 1], &small = sizes_[level];
  const std::vector<Mean> columns = means_of(large.width, small.width),
                          rows = means_of(large.height, small.height);
  std::size_t to = 0;
  for (std::size_t image = 0; image < images_; ++image) {
    for (const Mean& row : rows) {
      for (const Mean& column : columns) {
        for (std::size_t r = 0; r < row.weights.size(); ++r) {
          const std::size_t line = image * static_cast<std::size_t>(large.height) + row.first + r;
          for (std::size_t c = 0; c < column.weights.size(); ++c) {
            const float weight = row.weights[r] * column.weights[c];
            if (weight == 0) continue;
            const std::size_t from =
                channels_ * (line * static_cast<std::size_t>(large.width) + column.first + c);
            for (std::size_t channel = 0; channel < channels_; ++channel)
              function(to + channel, from + channel, weight);
          }
        }
        to += channels_;
      }
    }
  }
}

std::vector<std::vector<float>> TexturePyramid::smaller(std::span<const float> texels) const {
  std::vector<std::vector<float>> found;
  std::span<const float> large = texels;
  for (std::size_t level = 1; level < sizes_.size(); ++level) {
    std::vector<float> means(count(level));
    for_each_mean(level,
                  [&](std::size_t to, std::size_t from, float weight) { means[to] += weight * large[from]; });
    found.push_back(std::move(means));
    large = found.back();
  }
  return found;
}

void TexturePyramid::gather(std::span<const std::span<float>> gradients) const {
  for (std::size_t level = sizes_.size() - 1; level > 0; --level)
    for_each_mean(level, [&](std::size_t to, std::size_t from, float weight) {
      gradients[level - 1][from] += weight * gradients[level][to];
    });
}

}  // namespace dpr
