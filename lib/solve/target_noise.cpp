#include "solve/target_noise.hpp"

#include <algorithm>
#include <vector>

#include "solve/median.hpp"

namespace dpr {
namespace {

glm::dvec3 rgb(const cl_float4& color) { return {color.s[0], color.s[1], color.s[2]}; }

/// The mean of those that are not far from the others.
double trimmed_mean(const std::vector<double>& numbers) {
  constexpr double k_most = 8;  // medians
  const double most = k_most * median(numbers);
  double sum = 0, count = 0;
  for (const double number : numbers)
    if (number <= most) sum += number, ++count;
  return sum / count;
}

/// The square of how a pixel differs from its neighbours but for slopes, as large in the mean as the variance of noise
/// (Immerkaer 1996, "Fast noise variance estimation").
double roughness(std::span<const cl_float4> target, std::size_t width, std::size_t at) {
  constexpr double k_weights[] = {1, -2, 1};
  glm::dvec3 sum(0);
  for (std::size_t y = 0; y < 3; ++y)
    for (std::size_t x = 0; x < 3; ++x)
      sum += k_weights[y] * k_weights[x] * rgb(target[at + y * width + x - width - 1]);
  return glm::dot(sum, sum) / 36;
}

}  // namespace

TargetNoise noise_of(std::span<const cl_float4> target, std::span<const cl_float4> picture, std::size_t width,
                     const glm::vec3& background) {
  constexpr std::size_t k_least = 256;  // pixels that tell anything
  // Medians of squares of three channels are less than their means, and half of the noise has 0.68 of the mean square in
  // its variance: together 1.9.
  constexpr double k_most_of_roughness = 2;
  std::vector<double> squares, rough;
  for (std::size_t i = 0; i < target.size(); ++i) {
    const glm::dvec3 difference = rgb(target[i]) - glm::dvec3(background);
    if (!(picture[i].s[3] > 0)) squares.push_back(glm::dot(difference, difference));
  }
  if (squares.size() < k_least) return {};
  const double beside = trimmed_mean(squares);
  if (beside == 0) return {};
  for (std::size_t i = width; i + width < target.size(); ++i)
    if (!(picture[i].s[3] > 0) && i % width != 0 && (i + 1) % width != 0)
      rough.push_back(roughness(target, width, i));
  if (rough.size() < k_least) return {};
  const double uncovered = std::min(beside, k_most_of_roughness * median(rough));
  double halves = 0;  // channels in which half of the noise is cut off
  for (int channel = 0; channel < 3; ++channel)
    halves += background[channel] <= 0 || background[channel] >= 1 ? 1 : 0;
  return {uncovered, uncovered * (1 + halves / 3)};
}

}  // namespace dpr
