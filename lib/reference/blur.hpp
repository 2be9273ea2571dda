/// Reference for the blur by noise of the pixel's position: the density of the noise along one axis, and the
/// mean over a pixel's samples as a dense matrix.
#pragma once

#include "priors.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <vector>

namespace dpr::reference {

/// End of the noise, in scales, and the distance before it at which a cubic starts to take its density to
/// zero.
struct NoiseReach {
  double end = 0.0;
  double taper = 0.5;
};

inline NoiseReach noise_reach(Prior prior) {
  switch (prior) {
    case Prior::gaussian:
      return {4.5};
    case Prior::cauchy:
      return {10.0, 4.0};
    case Prior::logistic:
      return {10.5, 1.2};
    case Prior::uniform:
      return {0.5};
    case Prior::gumbel:
      break;
  }
  throw std::invalid_argument("noise_reach: the density is not symmetric");
}

/// Not normalised.
inline double noise_density(Prior prior, double x) {
  const NoiseReach reach = noise_reach(prior);
  const double left = std::clamp((reach.end - std::fabs(x)) / reach.taper, 0.0, 1.0);
  return density(prior, x) * left * left * (3.0 - 2.0 * left);
}

/// Rows are pixels, columns samples: `margin` before the frame, then `supersampling` a pixel, then `margin`
/// again. The density is sampled; the scale, in samples, is 1 or more.
using BlurMatrix = std::vector<std::vector<double>>;

inline BlurMatrix blur_matrix(Prior prior, double scale, int pixels, int supersampling, int margin) {
  const int samples = pixels * supersampling + 2 * margin;
  const int last = static_cast<int>(noise_reach(prior).end * scale) + 1;
  double sum = 0.0;
  for (int offset = -last; offset <= last; ++offset) sum += noise_density(prior, offset / scale);
  BlurMatrix matrix(static_cast<std::size_t>(pixels), std::vector<double>(static_cast<std::size_t>(samples)));
  for (int pixel = 0; pixel < pixels; ++pixel) {
    for (int sample = 0; sample < samples; ++sample) {
      for (int k = 0; k < supersampling; ++k) {
        const int offset = sample - margin - pixel * supersampling - k;
        matrix[static_cast<std::size_t>(pixel)][static_cast<std::size_t>(sample)] +=
            noise_density(prior, offset / scale) / sum / supersampling;
      }
    }
  }
  return matrix;
}

}  // namespace dpr::reference
