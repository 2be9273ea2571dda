#include "smoothing/priors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace dpr {
namespace {

double gaussian_density(double x) { return std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi); }

double gaussian_spectrum(double frequency) {
  const double x = 2 * std::numbers::pi * frequency;
  return std::exp(-0.5 * x * x);
}

/// 1 - Phi(x) = tail. Newton's method on ln(1 - Phi), which is concave and falls: from the right of the
/// solution it converges monotonically. It starts there, because 1 - Phi(x) <= exp(-x^2 / 2) / 2.
double gaussian_upper_quantile(double tail) {
  constexpr int k_most_steps = 100;
  double x = std::sqrt(-2 * std::log(2 * tail));
  for (int step = 0; step < k_most_steps; ++step) {
    const double q = 0.5 * std::erfc(x / std::numbers::sqrt2);
    const double change = (std::log(q) - std::log(tail)) * q / gaussian_density(x);
    x += change;
    if (std::abs(change) <= 1e-14 * x) break;
  }
  return x;
}

double logistic_density(double x) {
  const double e = std::exp(-std::abs(x));
  return e / ((1 + e) * (1 + e));
}

/// At a threshold of 1e-4 the tail would reach 3,183 sigmas; here p = 1/2 - atan(100) / pi = 3.18e-3.
constexpr double k_cauchy_reach = 100;

constexpr std::array<PriorRow, 5> k_priors{
    {{.prior = Prior::gaussian,
      .name = "gaussian",
      .upper_quantile = gaussian_upper_quantile,
      .density = gaussian_density,
      .score = [](double z) { return z; },
      .variance = 1,
      .hidden_behind = 8.5,
      .pixel_reach = 4.5,
      .spectrum = gaussian_spectrum,
      .pixel_nodes = 2},
     {.prior = Prior::cauchy,
      .name = "cauchy",
      .upper_quantile = [](double tail) { return 1 / std::tan(std::numbers::pi * tail); },
      .density = [](double x) { return 1 / (std::numbers::pi * (1 + x * x)); },
      .score = [](double z) { return 2 * z / (1 + z * z); },
      .longest_reach = k_cauchy_reach,
      .pixel_reach = 10,
      .pixel_taper = 4,
      .pixel_nodes = 7},
     {.prior = Prior::logistic,
      .name = "logistic",
      .upper_quantile = [](double tail) { return std::log1p(-tail) - std::log(tail); },
      .density = logistic_density,
      .score = [](double z) { return std::tanh(0.5 * z); },
      .variance = std::numbers::pi * std::numbers::pi / 3,
      .hidden_behind = 24,
      .pixel_reach = 10.5,
      .pixel_taper = 1.2},
     {.prior = Prior::gumbel,
      .name = "gumbel",
      .upper_quantile = [](double tail) { return -std::log(-std::log1p(-tail)); },
      .density = [](double x) { return std::exp(-x - std::exp(-x)); },
      .score = [](double z) { return -std::expm1(-z); },
      .asymmetric_quantile = [](double u) { return -std::log(-std::log(u)); },
      .variance = std::numbers::pi * std::numbers::pi / 6,
      .hidden_behind = 20.8},
     {.prior = Prior::uniform,
      .name = "uniform",
      .upper_quantile = [](double tail) { return 0.5 - tail; },
      .density = [](double x) { return std::abs(x) < 0.5 ? 1.0 : 0.0; },
      .score = nullptr,
      .variance = 1.0 / 12,
      .hidden_behind = 1,
      .pixel_reach = 0.5}}};

}  // namespace

std::span<const PriorRow> priors() { return k_priors; }

const PriorRow& row_of(Prior prior) { return k_priors.at(static_cast<std::size_t>(prior)); }

std::vector<std::string_view> scored_priors() {
  std::vector<std::string_view> names;
  for (const PriorRow& row : k_priors) {
    if (row.has_score()) names.push_back(row.name);
  }
  return names;
}

double quantile(Prior prior, double u) {
  const PriorRow& row = row_of(prior);
  if (!row.is_symmetric()) return row.asymmetric_quantile(u);
  return u < 0.5 ? -row.upper_quantile(u) : row.upper_quantile(1 - u);
}

double reach(Prior prior, double tail) {
  const PriorRow& row = row_of(prior);
  return std::min(row.upper_quantile(tail), row.longest_reach);
}

}  // namespace dpr
