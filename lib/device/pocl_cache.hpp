// The folder in which PoCL keeps what it compiles. Without it PoCL fails, and does not say why: it offers no
// device, it says that a program does not build, or it ends the process.
#pragma once

#include <string>

namespace dpr {

/// Why PoCL cannot write to its folder, and what to do; empty if it can. Makes the folder, as PoCL does.
std::string pocl_cache_failure();

}  // namespace dpr
