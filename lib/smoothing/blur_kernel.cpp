#include "smoothing/blur_kernel.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "base/checks.hpp"
#include "smoothing/priors.hpp"

namespace dpr {
namespace {

/// Symmetric about the middle.
using Weights = std::vector<double>;

/// Nodes of the coarse grid in a scale, where they need not be closer than 2 samples: with fewer the margin
/// grows.
constexpr double k_nodes = 6;
constexpr int k_least_spacing = 2;

/// Beyond so many samples the margin alone would be larger than any image.
constexpr double k_largest_scale = 65536;

void normalise(Weights& weights) {
  double sum = 0;
  for (const double weight : weights) sum += weight;
  for (double& weight : weights) weight /= sum;
}

double variance(const Weights& weights) {
  const auto middle = static_cast<double>(weights.size() / 2);
  double sum = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const double offset = static_cast<double>(i) - middle;
    sum += weights[i] * offset * offset;
  }
  return sum;
}

/// It and its derivative fall to zero at the reach.
double tapered_density(const PriorRow& row, double x) {
  const double left = std::clamp((row.pixel_reach - std::abs(x)) / row.pixel_taper, 0.0, 1.0);
  return left > 0 ? row.density(x) * left * left * (3 - 2 * left) : 0;
}

/// Weights of the samples at -radius ... radius: a density at each, or the integral of the uniform one over
/// its cell.
template <class Density>
Weights sampled(const PriorRow& row, double width, int radius, const Density& density) {
  Weights weights;
  for (int offset = -radius; offset <= radius; ++offset) {
    const double distance = std::abs(offset), half = width / 2;
    weights.push_back(row.prior == Prior::uniform
                          ? std::max(0.0, std::min(half, distance + 0.5) - std::max(-half, distance - 0.5))
                          : density(distance / width));
  }
  normalise(weights);
  return weights;
}

/// The largest offset with a weight.
int sample_radius(const PriorRow& row, double width) {
  const double end = row.prior == Prior::uniform ? (width + 1) / 2 : width * row.pixel_reach;
  return std::max(0, static_cast<int>(std::ceil(end)) - 1);
}

/// The width at which the weights of the samples have the variance of the density, if that has one. From the
/// width of 2 on a smooth density keeps it when it is sampled.
double sampled_width(const PriorRow& row, double scale) {
  constexpr double k_smooth = 2;
  constexpr int k_halvings = 50;
  const bool is_smooth = row.prior != Prior::uniform;
  constexpr double k_least = 1e-6;  // there no sample but the middle counts
  if (!std::isfinite(row.variance) || (is_smooth && scale >= k_smooth)) return std::max(scale, k_least);
  double low = k_least, high = scale + k_smooth;
  for (int i = 0; i < k_halvings; ++i) {
    const double width = (low + high) / 2;
    const int radius = sample_radius(row, 2 * width) + 1;  // without the taper
    const double found = variance(sampled(row, width, radius, row.density));
    (found < row.variance * scale * scale ? low : high) = width;
  }
  return (low + high) / 2;
}

/// Weights of the samples at -radius ... radius for the scale in samples.
Weights fine_weights(const PriorRow& row, double scale, int radius) {
  return sampled(row, sampled_width(row, scale), radius,
                 [&row](double x) { return tapered_density(row, x); });
}

/// Boxes as wide as the grid's spacing, one after the other, whose result is the quintic B-spline on samples.
/// Copies a spacing apart add up to a constant.
constexpr int k_boxes = 6;
Weights spline(int decimation) {
  Weights weights{1};
  for (int box = 0; box < k_boxes; ++box) {
    Weights wider(weights.size() + static_cast<std::size_t>(decimation) - 1);
    for (std::size_t i = 0; i < weights.size(); ++i) {
      for (int k = 0; k < decimation; ++k) wider[i + static_cast<std::size_t>(k)] += weights[i] / decimation;
    }
    weights = std::move(wider);
  }
  return weights;
}

/// The Fourier transform of the density, of scale 1; where the prior has none of its own, from samples.
double spectrum(const PriorRow& row, double frequency) {
  if (row.spectrum != nullptr) return row.spectrum(frequency);
  constexpr int k_samples_per_scale = 8;
  const int last = static_cast<int>(row.pixel_reach * k_samples_per_scale);
  double sum = tapered_density(row, 0), integral = sum;
  for (int i = 1; i <= last; ++i) {
    const double x = static_cast<double>(i) / k_samples_per_scale;
    const double density = 2 * tapered_density(row, x);
    integral += density;
    sum += density * std::cos(2 * std::numbers::pi * frequency * x);
  }
  return sum / integral;
}

/// Weights of the nodes at -radius ... radius for the scale in samples: the inverse transform of the
/// density's spectrum over that of the two splines.
Weights coarse_weights(const PriorRow& row, double scale, int decimation, int radius) {
  const int period = 2 * radius + 16;  // longer than the weights: what is behind them is nothing
  const double pi = std::numbers::pi;
  Weights weights(2 * static_cast<std::size_t>(radius) + 1);
  for (int i = 0; i <= period / 2; ++i) {
    const double frequency = static_cast<double>(i) / period;  // of the coarse grid
    const double box =
        i == 0 ? 1 : std::sin(pi * frequency) / (decimation * std::sin(pi * frequency / decimation));
    double amplitude = spectrum(row, frequency * scale / decimation) / std::pow(box, 2 * k_boxes);
    if (i > 0 && 2 * i < period) amplitude *= 2;  // for the negative frequency
    for (int node = -radius; node <= radius; ++node) {
      weights[static_cast<std::size_t>(node + radius)] += amplitude * std::cos(2 * pi * frequency * node);
    }
  }
  normalise(weights);
  return weights;
}

/// Rounded, with the rounding of their sum put right in the middle.
std::vector<float> rounded(const Weights& weights) {
  std::vector<float> floats(weights.begin(), weights.end());
  double error = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) error += weights[i] - static_cast<double>(floats[i]);
  // An even number of weights has two in the middle; an odd number has one, which gets both halves.
  floats[floats.size() / 2] += static_cast<float>(error / 2);
  floats[(floats.size() - 1) / 2] += static_cast<float>(error / 2);
  return floats;
}

/// The mean over the samples of a pixel.
Weights over_pixel(const Weights& weights, int supersampling) {
  const auto samples = static_cast<std::size_t>(supersampling);
  Weights mean(weights.size() + samples - 1);
  for (std::size_t i = 0; i < weights.size(); ++i) {
    for (std::size_t k = 0; k < samples; ++k) mean[i + k] += weights[i] / supersampling;
  }
  return mean;
}

/// The central difference of `weights_of`.
template <class WeightsOf>
Weights by_scale(double scale, const WeightsOf& weights_of) {
  constexpr double k_relative_step = 1e-4;
  const double step = k_relative_step * scale;
  Weights change(weights_of(scale).size());
  if (scale <= 0) return change;  // at 0 the derivative is 0, as it is by a variance's root
  const Weights above = weights_of(scale + step), below = weights_of(scale - step);
  for (std::size_t i = 0; i < change.size(); ++i) change[i] = (above[i] - below[i]) / (2 * step);
  return change;
}

/// `weights_of` and its derivative, both over the pixel's samples where they lead there.
template <class WeightsOf>
void set_weights(BlurKernel& kernel, double scale, int pixel_samples, const WeightsOf& weights_of) {
  kernel.weights = rounded(over_pixel(weights_of(scale), pixel_samples));
  Weights change = by_scale(scale, weights_of);
  for (double& weight : change) weight *= kernel.supersampling;
  kernel.weights_by_scale = rounded(over_pixel(change, pixel_samples));
}

/// Samples around the frame, however narrow the noise: a contour between the frame's last sample and the next
/// blends both, and what their colours change by is seen from the one behind.
constexpr int k_least_margin = 2;

void set_fine(BlurKernel& kernel, const PriorRow& row, double scale) {
  kernel.margin = std::max(sample_radius(row, sampled_width(row, scale)), k_least_margin);
  set_weights(kernel, scale, kernel.supersampling,
              [&](double s) { return fine_weights(row, s, kernel.margin); });
}

void set_coarse(BlurKernel& kernel, const PriorRow& row, double scale) {
  const int spacing = std::max(k_least_spacing, static_cast<int>(scale / std::max(k_nodes, row.pixel_nodes)));
  const int radius = static_cast<int>(std::ceil(row.pixel_reach * scale / spacing)) - 1;
  kernel.decimation = spacing;
  // To a pixel's outermost node, from there to its outermost neighbour, and to what that reads.
  kernel.margin = radius * spacing + k_boxes * (spacing - 1);
  Weights weights = spline(spacing);
  kernel.reduce = rounded(weights);
  for (double& weight : weights) weight *= spacing;
  weights = over_pixel(weights, kernel.supersampling);
  kernel.expand.assign(weights.begin(), weights.end());
  set_weights(kernel, scale, 1, [&](double s) { return coarse_weights(row, s, spacing, radius); });
}

/// Returns the scale in samples, after checks of all three.
double checked_scale(const PriorRow& row, double scale, int supersampling) {
  if (!row.is_symmetric()) {
    throw InvalidArgument("occupancy_prior (noise of the pixel)", std::string(row.name),
                          "a symmetric one: others shift the image");
  }
  if (supersampling != 1 && supersampling != 2 && supersampling != 4) {
    throw InvalidArgument("supersampling (noise of the pixel)", checks::text(supersampling), "1, 2 or 4");
  }
  const double in_samples = scale * supersampling;
  if (!(in_samples >= 0 && in_samples <= k_largest_scale)) {
    throw InvalidArgument("scale (noise of the pixel)", checks::text(scale) + " pixels",
                          "at least 0 and at most " + checks::text(k_largest_scale / supersampling));
  }
  return in_samples;
}

}  // namespace

BlurKernel blur_kernel(Prior prior, double scale, int supersampling) {
  const PriorRow& row = row_of(prior);
  const double in_samples = checked_scale(row, scale, supersampling);
  BlurKernel kernel;
  kernel.supersampling = supersampling;
  const bool is_coarse = in_samples >= k_least_spacing * row.pixel_nodes && prior != Prior::uniform;
  (is_coarse ? set_coarse : set_fine)(kernel, row, in_samples);
  return kernel;
}

ShiftTable shift_table(Prior prior, double scale, int supersampling) {
  const PriorRow& row = row_of(prior);
  const double in_samples = checked_scale(row, scale, supersampling);
  const int radius = sample_radius(row, sampled_width(row, in_samples));
  const auto weights_of = [&](double s) { return fine_weights(row, s, radius); };
  const Weights weights = weights_of(in_samples), change = by_scale(in_samples, weights_of);
  ShiftTable table;
  double sum = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    sum += weights[i];
    table.cumulative.push_back(static_cast<float>(sum));
    table.scores.push_back(weights[i] > 0 ? static_cast<float>(supersampling * change[i] / weights[i]) : 0);
  }
  return table;
}

}  // namespace dpr
