// The kernel sources, embedded at build time by cmake/EmbedKernels.cmake.
#pragma once

#include <string_view>

namespace dpr {

/// The text of a file in kernels/, e.g. "aggregate.cl" or "shared_types.h". Lives as long as the program.
/// Throws std::logic_error for a name that is not there.
std::string_view kernel_file(std::string_view name);
/// The same for the benchmark's kernels, bench/kernels/. Defined where the benchmark is linked.
std::string_view bench_kernel_file(std::string_view name);

}  // namespace dpr
