// A device's peaks, measured: what the stages' figures are compared with.
#pragma once

#include "dpr/device.hpp"

namespace dpr::bench {

inline constexpr double k_giga = 1e9;  // in which operations and bytes are counted

struct Peaks {
  double gflops = 0;        ///< 1e9 floating-point operations a second, a multiply-add counted as two
  double gbytes_per_s = 0;  ///< 1e9 bytes a second, read and written, by arrays far larger than the caches
};

/// The best of several runs of bench/kernels/peak.cl. About a second. Throws DeviceError.
Peaks measure_peaks(const Device& device);

}  // namespace dpr::bench
