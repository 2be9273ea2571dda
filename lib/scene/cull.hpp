// The names of what is culled, for files, command line and operator.
#pragma once

#include <string_view>

#include "dpr/scene.hpp"

namespace dpr {

/// Throws InvalidArgument that says `where` for another word than none, back or front.
Cull parse_cull(std::string_view word, std::string_view where);

}  // namespace dpr
