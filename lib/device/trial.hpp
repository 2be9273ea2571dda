// Trial of a device with the kernels of a frame, once in a process of its own: a driver that aborts ends that one, and
// one that hangs is left after DPR_TRIAL_SECONDS (300) at one kernel. The process is the dpr command, which is executed
// anew: a fork of a process whose OpenCL implementation has threads and locks could hang, or crash where the driver is
// without fault.
#pragma once

#include <optional>
#include <string>

#include "device/store.hpp"
#include "dpr/device.hpp"

namespace dpr {

struct Trial {
  double milliseconds = 0;  ///< of a small frame and its gradients
  std::string failure;      ///< the kernel that failed, and how; empty: all ran
};

/// Names the device, its driver, its lanes and the kernels: what the trial's process looks for.
std::string trial_name(const DeviceInfo& info);

/// The longest that a kernel of a trial may take, its compilation included: DPR_TRIAL_SECONDS, or 300.
unsigned trial_seconds();

/// The result of an earlier trial that allowed as long.
std::optional<Trial> remembered_trial(const DeviceInfo& info, const Store& store);

/// The same, or that of a trial now. Nothing where trials are switched off (DPR_TRIAL=off), where there is no
/// command or nothing can be remembered, or where the process failed otherwise, which an ordinary use tells.
std::optional<Trial> try_device(const DeviceInfo& info, const Store& store);

}  // namespace dpr
