// Uniform numbers that are the same with every standard library: its generators are, its distributions are
// not.
#pragma once

#include <cmath>
#include <random>

namespace dpr {

/// In [0, 1): the upper 53 bits of one draw.
inline double uniform_number(std::mt19937_64& generator) {
  return std::ldexp(static_cast<double>(generator() >> 11), -53);
}

}  // namespace dpr
