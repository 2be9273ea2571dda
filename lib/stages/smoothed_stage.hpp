// A stage whose kernels depend on the smoothing.
#pragma once

#include <memory>
#include <string>
#include <utility>

#include "device/kernel.hpp"
#include "dpr/smoothing.hpp"

namespace dpr {

/// `Kernels` are those of one estimator and prior; its member `built`, a string, names them. A smoothing is
/// set in two halves: the first prepares everything that can fail beside what is in force, the second swaps
/// it in.
template <class Kernels>
class SmoothedStage {
 public:
  /// A smoothing with the kernels that it needs.
  struct Setting {
    Smoothing smoothing;
    std::shared_ptr<Kernels> kernels;
  };

  void set(Setting&& prepared) noexcept { std::swap(now_, prepared); }

 protected:
  explicit SmoothedStage(Device::Impl& device) : device_(device) {}

  /// Kernels that `wanted` names are taken from what is in force, or else made by `build(kernels)`.
  template <class Build>
  Setting prepare(const Smoothing& smoothing, const std::string& wanted, const Build& build) const {
    Setting prepared{smoothing, now_.kernels};
    if (prepared.kernels && prepared.kernels->built == wanted) return prepared;
    prepared.kernels = std::make_shared<Kernels>();
    prepared.kernels->built = wanted;
    build(*prepared.kernels);
    return prepared;
  }

  Device::Impl& device_;
  Setting now_;
};

}  // namespace dpr
