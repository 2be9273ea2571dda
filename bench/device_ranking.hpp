// dpr bench --devices all: every device beside the others.
#pragma once

#include "measure_command.hpp"

namespace dpr::cli {

/// Measures every device of the machine on one workload, and prints a table, the fastest first: a frame and
/// its gradients, the first image, the time from a launch to its result, and the rate of transfers. A device
/// that fails is a line with the reason. Writes the same as JSON.
void rank_devices(const BenchMeasureOptions& options, const CommonOptions& common);

}  // namespace dpr::cli
