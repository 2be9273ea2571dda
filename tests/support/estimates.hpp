// Independent estimates of a number, and the members of the sampled family that are compared with the exact
// one.
#pragma once

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "dpr/smoothing.hpp"
#include "support/priors.hpp"
#include "support/reduced.hpp"

namespace dpr::test {

/// Mean and its standard error of independent estimates.
struct Estimate {
  double sum = 0, squares = 0;
  std::size_t count = 0;
  void add(double value) {
    sum += value;
    squares += value * value;
    ++count;
  }
  double mean() const { return sum / static_cast<double>(count); }
  double variance() const { return std::max(squares / static_cast<double>(count) - mean() * mean(), 0.0); }
  double standard_error() const { return std::sqrt(variance() / static_cast<double>(count - 1)); }
  /// True if the mean is within four standard errors of `exact`, or the estimates all agree with it.
  bool agrees_with(double exact) const {
    return std::abs(mean() - exact) <= 4 * standard_error() + 1e-6 * std::max(1.0, std::abs(exact));
  }
};

inline Estimate estimate_over(std::size_t count, const std::function<double(std::size_t)>& value) {
  Estimate e;
  for (std::size_t i = 0; i < count; ++i) e.add(value(i));
  return e;
}

#define DPR_CHECK_ESTIMATE(estimate, exact)                      \
  do {                                                           \
    const dpr::test::Estimate& checked = (estimate);             \
    const double wanted_value = (exact);                         \
    CAPTURE(checked.mean());                                     \
    CAPTURE(checked.standard_error());                           \
    CAPTURE(wanted_value);                                       \
    CHECK_MESSAGE(checked.agrees_with(wanted_value), #estimate); \
  } while (false)

/// The priors with a score.

/// A baseline and a way of drawing.
struct SamplingMode {
  VarianceReduction reduction = VarianceReduction::none;
  Draws draws = Draws::independent;
  std::string name() const { return std::string(to_string(reduction)) + " " + std::string(to_string(draws)); }
};

/// Those that validate() lets pass with priors that are symmetric, or not.
inline std::vector<SamplingMode> sampling_modes(bool symmetric) {
  std::vector<SamplingMode> modes;
  for (const auto draws : {Draws::independent, Draws::antithetic, Draws::stratified}) {
    if (draws == Draws::antithetic && !symmetric) continue;
    for (const auto reduction :
         {VarianceReduction::none, VarianceReduction::rigid, VarianceReduction::leave_one_out}) {
      if (draws == Draws::stratified && reduction == VarianceReduction::leave_one_out) continue;
      modes.push_back({reduction, draws});
    }
  }
  return modes;
}

/// In a simulator only the Gaussian prior goes through all modes.
inline std::vector<SamplingMode> sampling_modes(Prior prior) {
  if (is_reduced() && prior != Prior::gaussian) {
    return {{VarianceReduction::rigid, Draws::independent}};
  }
  return sampling_modes(prior != Prior::gumbel);
}

}  // namespace dpr::test
