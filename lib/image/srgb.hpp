// The transfer function of sRGB, IEC 61966-2-1: a line near black, a power above it.
#pragma once

#include <cmath>
#include <glm/glm.hpp>

namespace dpr {

inline float decode_srgb(float encoded) {
  if (encoded <= 0.0031308F * 12.92F) return encoded / 12.92F;
  return std::pow((encoded + 0.055F) / 1.055F, 2.4F);
}

inline float encode_srgb(float linear) {
  if (linear <= 0.0031308F) return linear * 12.92F;
  return 1.055F * std::pow(linear, 1 / 2.4F) - 0.055F;
}

/// The colour through one of the functions; alpha is linear.
inline glm::vec4 transferred(const glm::vec4& pixel, float (*transfer)(float)) {
  return {transfer(pixel.r), transfer(pixel.g), transfer(pixel.b), pixel.a};
}

}  // namespace dpr
