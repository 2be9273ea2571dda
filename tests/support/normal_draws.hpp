// Normal variables by the hundred million, the same with every standard library: Marsaglia & Tsang, "The
// Ziggurat Method for Generating Random Variables" (2000), with the whole of a 64-bit draw used once, after
// Doornik (2005).
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>

namespace dpr::test {

class NormalDraws {
 public:
  explicit NormalDraws(std::uint64_t seed) : engine_(seed) {
    edge_[0] = k_area / unnormalized(k_tail);
    edge_[1] = k_tail;
    for (std::size_t i = 2; i < k_layers; ++i) {
      edge_[i] = std::sqrt(-2 * std::log(k_area / edge_[i - 1] + unnormalized(edge_[i - 1])));
    }
    for (std::size_t i = 0; i < k_layers; ++i) inside_[i] = edge_[i + 1] / edge_[i];
  }

  double operator()() {
    for (;;) {
      const std::uint64_t bits = engine_();
      const std::size_t layer = bits % k_layers;
      const double u = 2 * uniform(bits) - 1;
      if (std::fabs(u) < inside_[layer]) return u * edge_[layer];
      if (layer == 0) return std::copysign(tail(), u);
      const double x = u * edge_[layer];
      const double low = unnormalized(edge_[layer]), high = unnormalized(edge_[layer + 1]);
      if (low + uniform(engine_()) * (high - low) < unnormalized(x)) return x;
    }
  }

 private:
  static constexpr std::size_t k_layers = 128;
  static constexpr double k_tail = 3.442619855899;       ///< where the lowest layer's tail begins
  static constexpr double k_area = 9.91256303526217e-3;  ///< of every layer, under exp(-x^2 / 2)

  static double unnormalized(double x) { return std::exp(-0.5 * x * x); }
  /// In [0, 1), from the upper 53 bits: the layer is in the lower ones.
  static double uniform(std::uint64_t bits) { return static_cast<double>(bits >> 11U) * 0x1p-53; }

  /// Beyond k_tail, by rejection from an exponential (Marsaglia 1964).
  double tail() {
    for (;;) {
      const double x = -std::log(1 - uniform(engine_())) / k_tail;
      const double y = -std::log(1 - uniform(engine_()));
      if (2 * y > x * x) return k_tail + x;
    }
  }

  std::mt19937_64 engine_;
  std::array<double, k_layers + 1> edge_{};  ///< right edges, from the lowest layer up; the last is 0
  std::array<double, k_layers> inside_{};    ///< share of a layer that is under the curve for certain
};

}  // namespace dpr::test
