// Sizes of tests: the full ones, or a few items where a simulator runs the kernels a thousand times slower.
#pragma once

#include <cstdlib>
#include <string_view>

namespace dpr::test {

/// True where the environment says DPR_TEST_REDUCED=1.
inline bool is_reduced() {
  const char* value = std::getenv("DPR_TEST_REDUCED");
  return value != nullptr && std::string_view(value) == "1";
}

inline int reduced(int full, int small) { return is_reduced() ? small : full; }

}  // namespace dpr::test
