// Times a workload: wall clock of the passes, device time of the stages, memory.
#pragma once

#include "cli/json.hpp"
#include "dpr/device.hpp"
#include "peaks.hpp"
#include "workloads.hpp"

namespace dpr::bench {

using cli::Json;

struct MeasureOptions {
  unsigned repetitions = 15;  ///< timed runs of a row, after one to warm up; then as many of its stages
  double max_seconds =
      30;  ///< a slow row stops repeating after that, its stages after half; one run each is timed
  bool tangents = false;  ///< forward mode as well, along one direction and along six
};

/// One row of the results. A row that fails or does not fit is a
/// row too: its "status" is "failed", "reason" says why, and there are no figures.
Json measure(const Device& device, const Peaks& peaks, const Workload& workload, const Variant& variant,
             const MeasureOptions& options);

/// Milliseconds to the first image of cube128 on the host, kernels built or read from the driver's cache.
double first_image_ms(const Device& device);

/// {"median", "q1", "q3", "min", "p95", "n"} of at least one value.
Json quartiles(std::vector<double> values);

}  // namespace dpr::bench
