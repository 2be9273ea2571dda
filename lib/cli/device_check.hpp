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

/// Tests the device; with `prints` every comparison is a line as soon as it is made. A device that cannot be
/// opened is a comparison that failed.
DeviceCheck check_device(const DeviceInfo& info, bool prints);

}  // namespace dpr::cli
