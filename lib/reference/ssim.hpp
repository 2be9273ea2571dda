/// Reference for the structural similarity of Wang, Bovik, Sheikh and Simoncelli (2004): window by window, in
/// double precision.
#pragma once

#include "loss.hpp"

namespace dpr::reference {

/// Weights of pixels in a window about one of them, and the constants, for values from 0 to 1.
struct SsimWindow {
  static constexpr int radius = 5;
  static constexpr double deviation = 1.5, c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;

  static double density(int squared) { return std::exp(-squared / (2.0 * deviation * deviation)); }
  static double weight(int dx, int dy) {
    static const double sum = [] {
      double of_row = 0.0;
      for (int k = -radius; k <= radius; ++k) of_row += density(k * k);
      return of_row * of_row;
    }();
    return density(dx * dx + dy * dy) / sum;
  }
};

inline double rgba_at(const Image& image, int column, int row, int channel) {
  return image.rgba[static_cast<std::size_t>(4 * (row * image.width + column) + channel)];
}

/// Similarity of one channel in the window about a pixel.
inline double window_ssim(const Image& image, const Image& target, int column, int row, int channel) {
  using W = SsimWindow;
  double x = 0.0, y = 0.0, xx = 0.0, yy = 0.0, xy = 0.0;
  for (int dy = -W::radius; dy <= W::radius; ++dy) {
    for (int dx = -W::radius; dx <= W::radius; ++dx) {
      x += W::weight(dx, dy) * rgba_at(image, column + dx, row + dy, channel);
      y += W::weight(dx, dy) * rgba_at(target, column + dx, row + dy, channel);
    }
  }
  for (int dy = -W::radius; dy <= W::radius; ++dy) {
    for (int dx = -W::radius; dx <= W::radius; ++dx) {
      const double a = rgba_at(image, column + dx, row + dy, channel) - x,
                   b = rgba_at(target, column + dx, row + dy, channel) - y;
      xx += W::weight(dx, dy) * a * a;
      yy += W::weight(dx, dy) * b * b;
      xy += W::weight(dx, dy) * a * b;
    }
  }
  return (2.0 * x * y + W::c1) * (2.0 * xy + W::c2) / ((x * x + y * y + W::c1) * (xx + yy + W::c2));
}

/// The mean over channels and windows within the image, weighed by the mask's first channel at their middle.
inline double mean_ssim(const Image& image, const Image& target, const Image& mask) {
  constexpr int r = SsimWindow::radius;
  double sum = 0.0, counted = 0.0;
  for (int row = r; row + r < image.height; ++row) {
    for (int column = r; column + r < image.width; ++column) {
      const double counts = rgba_at(mask, column, row, 0);
      for (int channel = 0; channel < 3 && counts > 0.0; ++channel) {
        sum += counts * window_ssim(image, target, column, row, channel);
        counted += counts;
      }
    }
  }
  return sum / counted;
}

}  // namespace dpr::reference
