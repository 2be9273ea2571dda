// The largest of many errors, for tests that compare whole buffers and say how wrong the worst value is.
#pragma once

#include <cmath>
#include <limits>
#include <sstream>
#include <string>

namespace dpr::test {

/// Worst error of comparisons. NaN is infinitely wrong, so that no comparison passes because of one.
struct Worst {
  double error = 0;
  std::string where = "nowhere";

  template <class... Parts>
  void add(double candidate, const Parts&... parts) {
    if (std::isnan(candidate)) candidate = std::numeric_limits<double>::infinity();
    if (!(candidate > error)) return;
    error = candidate;
    std::ostringstream text;
    ((text << parts << ' '), ...);
    where = text.str();
  }
};

}  // namespace dpr::test

/// The largest error is within the tolerance; if not, the message says where it is.
#define DPR_CHECK_WORST(worst, tolerance) \
  do {                                    \
    CAPTURE((worst).where);               \
    CHECK((worst).error <= (tolerance));  \
  } while (false)
