// The blur by noise of the pixel's position along one axis, as a dense matrix in double precision: from the
// noise's density, and from the library's weights.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <vector>

#include "reference/priors.hpp"
#include "smoothing/blur_kernel.hpp"

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

namespace dpr::test {

using reference::BlurMatrix;

/// rows x columns: weights[row * row_step - column * column_step + offset], where there is such a weight.
inline BlurMatrix banded_matrix(const std::vector<float>& weights, int rows, int columns, int row_step,
                                int column_step, int offset) {
  BlurMatrix matrix(static_cast<std::size_t>(rows), std::vector<double>(static_cast<std::size_t>(columns)));
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const int tap = row * row_step - column * column_step + offset;
      if (tap < 0 || tap >= static_cast<int>(weights.size())) continue;
      matrix[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)] =
          static_cast<double>(weights[static_cast<std::size_t>(tap)]);
    }
  }
  return matrix;
}

inline BlurMatrix product(const BlurMatrix& a, const BlurMatrix& b) {
  BlurMatrix result(a.size(), std::vector<double>(b.front().size()));
  for (std::size_t row = 0; row < a.size(); ++row) {
    for (std::size_t k = 0; k < b.size(); ++k) {
      if (a[row][k] == 0) continue;
      for (std::size_t column = 0; column < b[k].size(); ++column)
        result[row][column] += a[row][k] * b[k][column];
    }
  }
  return result;
}

/// From samples to pixels, with the kernel's weights or with their derivative.
inline BlurMatrix matrix_of(const BlurKernel& kernel, const std::vector<float>& weights, int pixels) {
  const int taps = static_cast<int>(weights.size());
  const int ss = kernel.supersampling, spacing = kernel.decimation;
  const int samples = pixels * ss + 2 * kernel.margin;
  if (spacing == 1) return banded_matrix(weights, pixels, samples, ss, 1, taps - 1);
  // Nodes at multiples of the spacing, more than enough on both sides of the frame.
  const int half = static_cast<int>(kernel.reduce.size()) / 2;
  const int before = 8 + taps, nodes = 2 * before + pixels * ss / spacing;
  const BlurMatrix reduce =
      banded_matrix(kernel.reduce, nodes, samples, spacing, 1, kernel.margin + half - before * spacing);
  const BlurMatrix convolve = banded_matrix(weights, nodes, nodes, 1, 1, taps / 2);
  const BlurMatrix expand =
      banded_matrix(kernel.expand, pixels, nodes, ss, spacing, before * spacing + half + ss - 1);
  return product(expand, product(convolve, reduce));
}

}  // namespace dpr::test
