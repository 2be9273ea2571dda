// The library's blur along one axis, as a dense matrix in double precision.
#pragma once

#include <cstddef>
#include <vector>

#include "reference/blur.hpp"
#include "smoothing/blur_kernel.hpp"

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
