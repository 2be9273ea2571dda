// Medians.
#pragma once

#include <algorithm>
#include <vector>

namespace dpr {

/// Of at least one number; of an even count the greater of the two in the middle.
template <typename Number>
Number median(std::vector<Number> numbers) {
  const auto middle = numbers.begin() + std::ssize(numbers) / 2;
  std::ranges::nth_element(numbers, middle);
  return *middle;
}

}  // namespace dpr
