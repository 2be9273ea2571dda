// Random lengths, choices and colours, from which shapes are drawn.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <random>

#include "base/uniform_number.hpp"

namespace dpr::learn {

/// The same draws for a seed with every standard library.
class Draw {
 public:
  explicit Draw(std::uint64_t seed) : generator_(seed) {}

  float between(float low, float high) {
    return low + (high - low) * static_cast<float>(uniform_number(generator_));
  }
  bool chance(float probability) { return between(0, 1) < probability; }
  int integer(int low, int high) {
    return std::min(high, low + static_cast<int>(between(0, 1) * static_cast<float>(high - low + 1)));
  }
  /// Colour of any hue, neither black nor white.
  glm::vec3 color() {
    const float hue = between(0, 6), strength = between(0.25F, 0.85F), value = between(0.45F, 0.95F);
    const auto channel = [&](float shift) {
      const float k = std::fmod(hue + shift, 6.0F);
      return value * (1 - strength * glm::clamp(std::min(k, 4 - k), 0.0F, 1.0F));
    };
    return {channel(5), channel(3), channel(1)};
  }
  glm::vec3 wood() {
    return glm::mix(glm::vec3(0.35F, 0.2F, 0.1F), glm::vec3(0.8F, 0.6F, 0.35F), between(0, 1));
  }
  glm::vec3 grey(float low, float high) { return glm::vec3(between(low, high)); }

 private:
  std::mt19937_64 generator_;
};

}  // namespace dpr::learn
