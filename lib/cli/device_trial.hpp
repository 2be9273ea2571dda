// dpr devices --trial: the process in which the library tries a driver.
#pragma once

#include <string>

namespace dpr::cli {

/// Renders a small frame and its gradients on the device of that name (device/trial.hpp). Prints every
/// program and kernel before it is built or run, and then how long such a frame takes. Throws InvalidArgument
/// for a name that no device has: another version's command.
void run_trial(const std::string& name);

}  // namespace dpr::cli
