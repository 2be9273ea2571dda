// The perturbed Heaviside of every fragment, exact or sampled. The sampled joint composition has no such
// stage: there aggregation perturbs the distances together with the depths.
#pragma once

#include <optional>
#include <string>

#include "device/kernel.hpp"
#include "dpr/smoothing.hpp"
#include "stages/bin.hpp"
#include "stages/rasterize.hpp"
#include "stages/smoothed_stage.hpp"

namespace dpr {

/// Kernels of one estimator and prior; `built` names them.
struct OccupancyKernels {
  /// Kernels of the exact and of the sampled estimator, for one prior.
  struct Exact {
    Exact(Device::Impl& device, const std::string& options);
    Kernel<shared::OccupancyParams, cl_uint, In<cl_uint>, In<float>, Out<float>, Out<float>> forward;
    Kernel<shared::OccupancyParams, cl_uint2, In<cl_uint>, In<float>, In<float>, Out<float>, Out<float>>
        backward;
  };
  struct Sampled {
    Sampled(Device::Impl& device, const std::string& options);
    Kernel<shared::OccupancyParams, cl_uint, In<cl_uint>, In<cl_uint>, In<cl_uint>, In<float>, Out<float>,
           Out<float>>
        forward;
    Kernel<shared::OccupancyParams, cl_uint, In<cl_uint>, In<cl_uint>, In<cl_uint>, In<float>, In<float>,
           In<float>, Out<float>, Out<float>>
        backward;
  };

  std::string built;
  std::optional<Exact> exact;
  std::optional<Sampled> sampled;
};

class Occupancy : public SmoothedStage<OccupancyKernels> {
 public:
  explicit Occupancy(Device::Impl& device) : SmoothedStage(device) {}

  /// Everything about setting the smoothing that can fail: builds what it needs; cheap where that is there
  /// already.
  Setting prepare(const Smoothing& smoothing) const;
  void set_smoothing(const Smoothing& smoothing) { set(prepare(smoothing)); }

  void forward(const shared::FrameParams& p, const Bin& bin, const Rasterize& rasterize);
  void backward(const shared::FrameParams& p, const Bin& bin, const Rasterize& rasterize,
                const Buffer<float>& grad_log_occupancy);
  /// Says how many fragments there are, where forward() could not know.
  void settle(std::size_t fragments);

  static constexpr std::size_t k_fragment_bytes = 3 * sizeof(float);  ///< of those below

  Buffer<float> log_occupancy, occupancy;  ///< [fragment]
  Buffer<float> grad_distance;             ///< [fragment]
  Buffer<float> grad_sigma;                ///< [pair]

  std::size_t bytes() const;

 private:
  shared::OccupancyParams params(const shared::FrameParams& p) const;
};

/// The build option that chooses a prior.
std::string prior_option(Prior prior);

/// True for the sampled joint composition.
bool samples_jointly(const Smoothing& smoothing);

/// Sampling of the Monte Carlo estimators of either stage.
shared::Sampling sampling_params(const Smoothing& smoothing);

}  // namespace dpr
