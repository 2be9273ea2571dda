// The perturbed Heaviside of every fragment, exact or sampled. The sampled joint composition has no such
// stage: there aggregation perturbs the distances together with the depths.
#pragma once

#include <optional>
#include <string>

#include "dpr/smoothing.hpp"
#include "kernels/occupancy.hpp"
#include "kernels/occupancy_sampled.hpp"
#include "stages/bin.hpp"
#include "stages/rasterize.hpp"
#include "stages/smoothed_stage.hpp"

namespace dpr {

/// Kernels of one estimator and prior; `built` names them.
struct OccupancyKernels {
  std::string built;
  std::optional<Launcher<kernel::occupancy_forward, kernel::occupancy_backward, kernel::occupancy_tangent>>
      exact;
  std::optional<Launcher<kernel::occupancy_sampled_forward, kernel::occupancy_sampled_backward>> sampled;
};

class Occupancy : public SmoothedStage<OccupancyKernels> {
 public:
  explicit Occupancy(Device::Impl& device) : SmoothedStage(device) {}

  /// Everything about setting the smoothing that can fail: builds what it needs; cheap where that is there
  /// already.
  Setting prepare(const Smoothing& smoothing) const;
  void set_smoothing(const Smoothing& smoothing) { set(prepare(smoothing)); }

  void forward(const shared::FrameParams& p, const Bin& bin, Rasterize& rasterize);
  void backward(const shared::FrameParams& p, const Bin& bin, Rasterize& rasterize);

  /// From the tangents of distances to those of ln p. Only with the exact estimator.
  void tangent(const shared::FrameParams& p, const Rasterize& rasterize, Tangents& tangents);

  Buffer<float> grad_sigma;  ///< [pair]

  bool is_sampled() const { return now_.smoothing.occupancy_estimator == Estimator::monte_carlo; }
  std::size_t bytes() const { return grad_sigma.capacity_bytes(); }

 private:
  shared::OccupancyParams params(const shared::FrameParams& p) const;
};

/// The build option that chooses a prior; none for that of kernels/frame.cl.
std::string prior_option(Prior prior);

/// True for the sampled joint composition.
bool samples_jointly(const Smoothing& smoothing);

/// Sampling of the Monte Carlo estimators of either stage.
shared::Sampling sampling_params(const Smoothing& smoothing);

}  // namespace dpr
