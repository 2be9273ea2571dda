#include "smoothing/prior_functions.hpp"

#include <cmath>
#include <numbers>

namespace dpr {
namespace {

// x >= 0 with 1 - Phi(x) = tail <= 1/2. Newton's method on ln(1 - Phi), which is concave and falls: from the
// right of the solution it converges monotonically. It starts there, because 1 - Phi(x) <= exp(-x^2 / 2) / 2.
double gaussian_upper_quantile(double tail) {
  constexpr int k_most_steps = 100;
  double x = std::sqrt(-2 * std::log(2 * tail));
  for (int step = 0; step < k_most_steps; ++step) {
    const double q = 0.5 * std::erfc(x / std::numbers::sqrt2);
    const double density = std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi);
    const double change = (std::log(q) - std::log(tail)) * q / density;
    x += change;
    if (std::abs(change) <= 1e-14 * x) break;
  }
  return x;
}

}  // namespace

double upper_quantile(Prior prior, double tail) {
  switch (prior) {
    case Prior::gaussian:
      return gaussian_upper_quantile(tail);
    case Prior::cauchy:
      return 1 / std::tan(std::numbers::pi * tail);
    case Prior::logistic:
      return std::log1p(-tail) - std::log(tail);
    case Prior::gumbel:
      return -std::log(-std::log1p(-tail));
    case Prior::uniform:
      return 0.5 - tail;
  }
  return 0;
}

double quantile(Prior prior, double u) {
  if (prior == Prior::gumbel) return -std::log(-std::log(u));
  return u < 0.5 ? -upper_quantile(prior, u) : upper_quantile(prior, 1 - u);  // the others are symmetric
}

double score(Prior prior, double z) {
  switch (prior) {
    case Prior::gaussian:
      return z;
    case Prior::cauchy:
      return 2 * z / (1 + z * z);
    case Prior::logistic:
      return std::tanh(0.5 * z);
    case Prior::gumbel:
      return -std::expm1(-z);
    case Prior::uniform:
      break;
  }
  return 0;
}

}  // namespace dpr
