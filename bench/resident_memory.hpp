// The most memory this process has held.
#pragma once

#include <cstddef>

namespace dpr::bench {

/// Counts anew from here, where the system can (Linux: /proc/self/clear_refs).
void reset_peak_resident_bytes();

/// Since the last reset, or since the process began.
std::size_t peak_resident_bytes();

}  // namespace dpr::bench
