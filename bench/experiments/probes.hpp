// The two smoothed operators by way of the renderer itself: scenes of one pixel in which nothing else
// happens.
#pragma once

#include <span>
#include <vector>

#include "dpr/device.hpp"
#include "dpr/smoothing.hpp"

namespace dpr::experiments {

/// An operator's value and derivative at every argument asked for.
struct Response {
  std::vector<double> value, derivative;
};

/// p(x), the perturbed Heaviside (8), x = s / sigma, and dp/dx: the alpha of a pixel that a triangle's
/// straight border passes at that distance. All arguments are views of one batch, so where they are sampled,
/// equal arguments are independent estimates. Sigma, blur radius and metric are the probe's.
Response heaviside(const Device& device, const Smoothing& smoothing, std::span<const double> x);

/// The perturbed arg-max' weight (9) of a depth beta = zeta / gamma that moves past two others, at 0 and -2,
/// and its derivative: the red of a pixel that three triangles cover wholly, the moving one red. Batched
/// likewise. Gamma and the background's depth are the probe's.
Response arg_max(const Device& device, const Smoothing& smoothing, std::span<const double> beta);

}  // namespace dpr::experiments
