// Numbers of vertices at samples, into the caller's memory.
#pragma once

#include "dpr/interpolate.hpp"

namespace dpr {

/// As the function that returns them. Throws InvalidArgument for another size, too.
void interpolate(const Samples& samples, const Attributes& attributes, std::span<float> values);

}  // namespace dpr
