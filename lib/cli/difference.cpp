#include "cli/difference.hpp"

#include <algorithm>
#include <cmath>

namespace dpr::cli {
namespace {

constexpr float k_least = 1.0F / 255;  // what 8 bits tell apart
constexpr int k_most_gain = 8;  // more would make what is right look wrong

Image difference(const Image& a, const Image& b) {
  Image result = a;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) result.pixels[i] = glm::abs(a.pixels[i] - b.pixels[i]);
  return result;
}

int gain_of(const std::vector<Image>& images) {
  std::vector<float> values;
  for (const Image& image : images) {
    for (const glm::vec4& pixel : image.pixels) {
      const float value = std::max({pixel.r, pixel.g, pixel.b});
      if (value * k_most_gain >= k_least) values.push_back(value);
    }
  }
  if (values.empty()) return 1;
  const auto high = values.begin() + static_cast<std::ptrdiff_t>(99 * (values.size() - 1) / 100);
  std::ranges::nth_element(values, high);
  int gain = 1;
  while (gain < k_most_gain && 2 * static_cast<float>(gain) * *high < 1) gain *= 2;
  return gain;
}

}  // namespace

std::string Differences::caption() const {
  return gain == 1 ? "difference" : "difference, " + std::to_string(gain) + " times as bright";
}

Differences differences(const std::vector<Image>& a, const std::vector<Image>& b) {
  Differences result;
  for (std::size_t i = 0; i < a.size(); ++i) result.images.push_back(difference(a[i], b[i]));
  result.gain = gain_of(result.images);
  for (Image& image : result.images) {
    for (glm::vec4& pixel : image.pixels) pixel *= static_cast<float>(result.gain);
  }
  return result;
}

}  // namespace dpr::cli
