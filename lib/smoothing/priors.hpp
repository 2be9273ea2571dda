// The table of priors, in double precision. Their kernels are kernels/prior_<name>.h.
#pragma once

#include <limits>
#include <span>
#include <string_view>
#include <vector>

#include "dpr/smoothing.hpp"

namespace dpr {

struct PriorRow {
  Prior prior;
  std::string_view name;  ///< in files and messages, and of the kernel's functions
  /// x with P(X > x) = tail, for tail in (0, 1/2].
  double (*upper_quantile)(double tail);
  double (*density)(double x);
  /// nu'(z) of the density exp(-nu); null where there is none, so that gradients cannot be sampled.
  double (*score)(double z);
  /// The inverse CDF of u in (0, 1); null where the density is symmetric about 0 and upper_quantile says it.
  double (*asymmetric_quantile)(double u) = nullptr;
  /// Upper bound of the blur radius, in sigmas, for any occupancy there.
  double longest_reach = std::numeric_limits<double>::infinity();
  double variance = std::numeric_limits<double>::infinity();
  /// Depth difference, in scales, beyond which the further surface is in front with a probability below 1e-9.
  double hidden_behind = std::numeric_limits<double>::infinity();
  /// Noise of a pixel's position: where it ends, in scales, and how far before that its density, there below
  /// 4e-4 of the peak, Cauchy's below 3e-2, starts to fall to zero.
  double pixel_reach = 0, pixel_taper = 0.5;
  /// The Fourier transform of the density; null where it is that of what is left of it within the reach.
  double (*spectrum)(double frequency) = nullptr;
  /// Nodes of a coarse grid that a scale needs for an error below 2e-4 of the peak.
  double pixel_nodes = 4;

  bool has_score() const { return score != nullptr; }
  bool is_symmetric() const { return asymmetric_quantile == nullptr; }
};

/// In the order of the enumeration.
std::span<const PriorRow> priors();
const PriorRow& row_of(Prior prior);

/// The names of those with a score, which can be sampled.
std::vector<std::string_view> scored_priors();

/// The inverse CDF of u in (0, 1).
double quantile(Prior prior, double u);

/// x in sigmas at which the occupancy outside has fallen to `tail`, at most the prior's longest reach.
double reach(Prior prior, double tail);

}  // namespace dpr
