/// Central finite differences against analytic gradients, with a verdict instead of an assertion, so that a
/// test can also demand that a wrong gradient is rejected.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <vector>

namespace dpr::reference {

struct GradientCheck {
  double error = 0.0;  ///< largest deviation over the largest component of the gradient, found or expected
  std::size_t worst = 0;
  double expected = 0.0;  ///< finite difference there
  double found = 0.0;     ///< analytic gradient there
  bool passed = false;
};

using ScalarFunction = std::function<double(const std::vector<double>&)>;

/// Compares `gradient` with central differences of `f` at `at`: |difference| <= tolerance * largest component
/// + floor.
inline GradientCheck check_gradient(const ScalarFunction& f, std::vector<double> at,
                                    const std::vector<double>& gradient, double step, double tolerance,
                                    double floor = 1e-12) {
  GradientCheck check;
  if (gradient.size() != at.size()) return check;
  std::vector<double> difference;
  double largest = 0.0;
  for (std::size_t i = 0; i < at.size(); ++i) {
    const double center = at[i];
    at[i] = center + step;
    const double above = f(at);
    at[i] = center - step;
    const double below = f(at);
    at[i] = center;
    difference.push_back((above - below) / (2.0 * step));
    largest = std::max({largest, std::fabs(difference[i]), std::fabs(gradient[i])});
  }
  check.passed = true;
  for (std::size_t i = 0; i < at.size(); ++i) {
    const double deviation = std::fabs(difference[i] - gradient[i]);
    if (!(deviation <= tolerance * largest + floor)) check.passed = false;  // NaN fails
    const double error = largest > 0.0 ? deviation / largest : deviation;
    if (i == 0 || !(error <= check.error)) check = {error, i, difference[i], gradient[i], check.passed};
  }
  return check;
}

}  // namespace dpr::reference
