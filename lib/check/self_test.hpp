// A self-test of a device: every stage on small scenes, against the reference in double precision.
#pragma once

#include <functional>
#include <string>

#include "dpr/device.hpp"

namespace dpr::check {

/// A comparison of what the device computed with the reference.
struct CheckRow {
  std::string stage = {};     ///< as kernels/README.md names it
  std::string compared = {};  ///< what, and in which unit
  double worst = 0;           ///< largest difference; infinite where one is not finite
  double bound = 0;           ///< what it may be
  double seconds = 0;         ///< with the kernels' compilation and the reference's work
  std::string error = {};     ///< of a device that failed in place of a result

  bool passed() const { return error.empty() && worst <= bound; }
};

/// Calls back after every comparison. Where the device fails, a row says so and the next stage is tried. The
/// same comparisons on every device; those with random numbers draw the same ones.
void self_test(const Device& device, const std::function<void(const CheckRow&)>& on_row);

}  // namespace dpr::check
