// Reach of a smoothing, and its derivative by sigma.
#include "dpr/smoothing.hpp"
#include "smoothing/priors.hpp"

namespace dpr {

float blur_radius(const Smoothing& smoothing) {
  if (smoothing.noise == Noise::pixel) return 0;
  if (smoothing.blur_radius) return *smoothing.blur_radius;
  const double tail = static_cast<double>(smoothing.occupancy_threshold);
  return static_cast<float>(reach(smoothing.occupancy_prior, tail) * static_cast<double>(smoothing.sigma));
}

void set_sigma(Smoothing& smoothing, float sigma) {
  const bool is_width = smoothing.occupancy_width == OccupancyWidth::fixed;
  if (smoothing.blur_radius && is_width) *smoothing.blur_radius *= sigma / smoothing.sigma;
  smoothing.sigma = sigma;
}

}  // namespace dpr
