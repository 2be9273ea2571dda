// The environment that a measurement depends on, beside the program and the OpenCL device.
#pragma once

#include "cli/json.hpp"

namespace dpr::bench {

/// {"date": UTC, ISO 8601; "host"; "os"; "kernel"; "cpu"; "cpus"; "clock_mhz", 0 where it is not known;
/// "variables": those of the process that drivers and this library look at, by name}.
cli::Json environment();

/// Processes that want to run, the mean of the last minute; 0 where it is not known.
double load();

}  // namespace dpr::bench
