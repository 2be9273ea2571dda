// Checks of preset names for readers of files and options.
#pragma once

#include <string_view>

#include "dpr/smoothing.hpp"

namespace dpr {

/// Throws InvalidArgument, which calls the argument `where`, for what is no preset's name.
void require_preset(std::string_view name, std::string_view where);

}  // namespace dpr
