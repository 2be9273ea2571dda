// dpr devices --check: the self-test of one device, as text or JSON.
#pragma once

#include "cli/json.hpp"
#include "dpr/device.hpp"

namespace dpr::cli {

struct DeviceCheck {
  std::size_t comparisons = 0, failed = 0;
  double seconds = 0;
  Json rows = Json::array();  ///< stage, compared, worst, bound, passed, seconds; error in place of a result
};

/// Tests the device in a process of its own: kernels index by what other kernels left, and on a CPU what is
/// wrong there ends the process that runs them. With `prints` every comparison is a line as soon as it is
/// made. A device that cannot be opened is a comparison that failed, and so is a process that ended.
DeviceCheck check_device(const DeviceInfo& info, bool prints);

/// The work of that process, `dpr devices --check-rows INDEX`: prints every comparison as a line of JSON.
void print_check_rows(std::size_t index);

}  // namespace dpr::cli
