// Synthetic pixels of every kind, and how far the aggregation stage is from the reference on them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "support/reduced.hpp"
#include "support/synthetic_pixels.hpp"
#include "support/worst.hpp"

namespace dpr::test {

/// Uniform numbers that are the same with every standard library.
class RandomFloat {
 public:
  explicit RandomFloat(unsigned seed) : engine_(seed) {}
  float operator()(float low, float high) {
    return low + (high - low) * static_cast<float>(engine_() >> 8U) * 0x1p-24F;
  }
  glm::vec3 color() {
    const float r = (*this)(0, 1), g = (*this)(0, 1);
    return {r, g, (*this)(0, 1)};
  }

 private:
  std::mt19937 engine_;
};

/// How a pixel's occupancies are drawn: all 1; over the unit interval; 0, 1 and tiny ones among others; over
/// 30 decades.
enum class Occupancies { solid, any, extreme, decades };

inline float draw_occupancy(Occupancies kind, RandomFloat& random) {
  const float u = random(0, 1);
  switch (kind) {
    case Occupancies::solid:
      return 1;
    case Occupancies::any:
      return u;
    case Occupancies::extreme:
      return u < 0.2F ? 0.0F : u < 0.4F ? 1.0F : u < 0.6F ? 1e-20F : u < 0.8F ? 1.0F - 6e-8F : random(0, 1);
    case Occupancies::decades:
      return std::pow(10.0F, -30.0F * u);
  }
  return 0;
}

/// `spread`: the interval the depths fill, in units of gamma, as far as the camera's range allows.
inline SyntheticPixel make_pixel(int fragments, float spread, float gamma, Occupancies kind,
                                 RandomFloat& random) {
  const float range = k_zfar - k_znear;
  const float reach = std::min(spread * gamma * range, 90.0F);
  const float nearest = random(1.5F, 8.0F);
  SyntheticPixel pixel;
  for (int k = 0; k < fragments; ++k) {
    SyntheticFragment f;
    f.depth = nearest + reach * random(0, 1);
    f.occupancy = draw_occupancy(kind, random);
    f.color = random.color();
    pixel.push_back(f);
  }
  return pixel;
}

/// Pixels from none to 40 fragments, from coincident to far apart, with every kind of occupancy.
inline std::vector<SyntheticPixel> make_pixels(float gamma, unsigned seed) {
  RandomFloat random(seed);
  const std::vector<int> counts = is_reduced() ? std::vector<int>{0, 1, 3, 7}
                                               : std::vector<int>{0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 15, 20, 40};
  const std::vector<float> spreads =
      is_reduced() ? std::vector<float>{0, 3} : std::vector<float>{0, 0.3F, 1, 3, 8, 20, 60, 300, 1e4F};
  std::vector<SyntheticPixel> pixels;
  unsigned kind = 0;
  for (const int count : counts) {
    for (const float spread : spreads) {
      pixels.push_back(make_pixel(count, spread, gamma, static_cast<Occupancies>(kind++ % 4), random));
    }
  }
  return pixels;
}

/// Pixels of 300 fragments, coincident, in one heap, far apart; and fewer where the rules change their nodes.
inline std::vector<SyntheticPixel> make_crowds(float gamma, unsigned seed) {
  RandomFloat random(seed);
  std::vector<SyntheticPixel> pixels;
  for (const float spread : {0.0F, 5.0F, 300.0F}) {
    pixels.push_back(make_pixel(reduced(300, 20), spread, gamma, Occupancies::any, random));
  }
  pixels.push_back(make_pixel(reduced(300, 20), 5, gamma, Occupancies::decades, random));
  for (const int count : {reduced(40, 9), reduced(41, 10), reduced(120, 11)}) {
    for (const float spread : {0.0F, 2.0F}) {
      pixels.push_back(make_pixel(count, spread, gamma, Occupancies::any, random));
      pixels.push_back(make_pixel(count, spread, gamma, Occupancies::solid, random));
    }
  }
  return pixels;
}

/// Absolute errors of weights (background's included), colours and alphas; of the gradients the error over
/// the largest gradient of the pixel, or over 0.01 where all are smaller. The gradients of gamma and alpha
/// are sums of the fragments' gradients times beta by depth, or ln p / alpha: their errors count over the sum
/// of the terms' magnitudes, a gradient below 0.01 of its weight as that. Depth and gamma count in units of
/// gamma, alpha in its own.
struct AggregateErrors {
  Worst weight, color, alpha, grad_depth, grad_log_occupancy, grad_gamma, grad_alpha;
};

inline constexpr double k_least_gradient = 0.01;

inline double number(float value) { return static_cast<double>(value); }

/// One pixel's errors. `pixel` is what the reference gets, the rest what the stage found.
inline void add_errors(const SyntheticPixel& pixel, const reference::AggregateParameters& p,
                       const cl_float4& image, const cl_float4& grad, const SyntheticFrame::Gradients& found,
                       std::size_t i, AggregateErrors& errors) {
  const std::vector<reference::FragmentInput> inputs = reference_fragments(pixel);
  const reference::AggregateResult result = reference::aggregate_forward(inputs, p);
  const reference::Vec3d grad_color{number(grad.s[0]), number(grad.s[1]), number(grad.s[2])};
  const reference::AggregateGradient wanted =
      reference::aggregate_backward(inputs, p, grad_color, number(grad.s[3]));
  const auto where = [&](Worst& worst, double error, std::size_t k, double have, double want) {
    worst.add(error, "pixel", i, "of", pixel.size(), "fragment", k, "found", have, "wanted", want);
  };
  const std::size_t n = pixel.size();
  for (std::size_t c = 0; c < 3; ++c) {
    const double have = number(image.s[c]);
    where(errors.color, std::abs(have - result.color[c]), n, have, result.color[c]);
  }
  where(errors.alpha, std::abs(number(image.s[3]) - result.silhouette), n, number(image.s[3]),
        result.silhouette);
  const double background = number(found.background[i].x) / grad_color.x;
  where(errors.weight, std::abs(background - result.background_weight), n, background,
        result.background_weight);

  const double unit = p.gamma * (p.zfar - p.znear);
  std::vector<double> by_log(n);
  double largest_depth = k_least_gradient, largest_log = k_least_gradient;
  double gamma_size = k_least_gradient, alpha_size = k_least_gradient;
  double nearest = p.zfar, depth_sum = 0;
  for (const reference::FragmentInput& input : inputs) nearest = std::min(nearest, input.depth);
  for (std::size_t k = 0; k < n; ++k) {
    const reference::FragmentInputGradient& g = wanted.fragments[k];
    by_log[k] = g.log_occupancy + inputs[k].occupancy * g.occupancy;
    largest_depth = std::max(largest_depth, std::abs(g.depth * unit));
    largest_log = std::max(largest_log, std::abs(by_log[k]));
    const double size = std::max(std::abs(g.depth) * unit, k_least_gradient * result.weights[k]);
    gamma_size += size * (inputs[k].depth - nearest) / unit;
    depth_sum += g.depth * unit;
    if (inputs[k].occupancy > 0) alpha_size -= size * inputs[k].log_occupancy / p.alpha;
  }
  // The background slot's share: its gradient is minus the sum of the others.
  if (p.composition == reference::Composition::barrier) {
    const double size = std::max(std::abs(depth_sum), k_least_gradient * result.background_weight);
    gamma_size += size * ((p.zfar - nearest) / (p.zfar - p.znear) - p.background_depth) / p.gamma;
  }
  for (std::size_t k = 0; k < n; ++k) {
    const double weight = number(found.red[i][k]) / grad_color.x;
    where(errors.weight, std::abs(weight - result.weights[k]), k, weight, result.weights[k]);
    const double other = std::max(std::abs(number(found.green[i][k]) / grad_color.y - weight),
                                  std::abs(number(found.blue[i][k]) / grad_color.z - weight));
    where(errors.weight, other, k, weight, result.weights[k]);
    const double depth = number(found.depth[i][k]), log_p = number(found.log_occupancy[i][k]);
    const double want = wanted.fragments[k].depth;
    where(errors.grad_depth, std::abs(depth - want) * unit / largest_depth, k, depth * unit, want * unit);
    // The joint composition stops at an opaque fragment: for p = 1 itself it takes the background to be what
    // it hides. No harm is done, because d ln p / ds is below 1e-6 there.
    if (p.composition == reference::Composition::joint && pixel[k].occupancy == 1) continue;
    where(errors.grad_log_occupancy, std::abs(log_p - by_log[k]) / largest_log, k, log_p, by_log[k]);
  }
  const double gamma = number(found.gamma[i]), alpha = number(found.alpha[i]);
  where(errors.grad_gamma, std::abs(gamma - wanted.gamma) * p.gamma / gamma_size, n, gamma * p.gamma,
        wanted.gamma * p.gamma);
  where(errors.grad_alpha, std::abs(alpha - wanted.alpha) * p.alpha / alpha_size, n, alpha * p.alpha,
        wanted.alpha * p.alpha);
}

inline constexpr glm::vec3 k_background{0.3F, 0.7F, 0.1F};

/// Gradients of an image, none of them zero.
inline std::vector<cl_float4> make_grad_image(std::size_t pixels, unsigned seed) {
  RandomFloat random(seed);
  std::vector<cl_float4> grad;
  for (std::size_t i = 0; i < pixels; ++i) {
    cl_float4 g{};
    for (float& value : g.s) value = (random(0, 1) < 0.5F ? -1.0F : 1.0F) * random(0.3F, 1.0F);
    grad.push_back(g);
  }
  return grad;
}

/// Renders the pixels and adds their errors. `distortion` multiplies what the stage found: 1, but where a
/// test shows that a wrong result is noticed.
inline void compare_with_reference(const std::vector<SyntheticPixel>& pixels, const Smoothing& smoothing,
                                   AggregateErrors& errors, float distortion = 1) {
  SyntheticFrame frame(pixels);
  const std::vector<cl_float4> grad_image = make_grad_image(pixels.size(), 7);
  std::vector<cl_float4> image = frame.forward(smoothing, k_background);
  SyntheticFrame::Gradients found = frame.backward(k_background, grad_image);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    for (float& value : image[i].s) value *= distortion;
    for (auto* values : {&found.depth, &found.log_occupancy, &found.red, &found.green, &found.blue}) {
      for (float& value : (*values)[i]) value *= distortion;
    }
    found.gamma[i] *= distortion;
    found.alpha[i] *= distortion;
    add_errors(pixels[i], reference_parameters(smoothing, k_background), image[i], grad_image[i], found, i,
               errors);
  }
}

}  // namespace dpr::test
