/// Noise priors of the perturbed renderer in double precision: F, its logarithm, density, hazard and score.
/// Le Lidec et al. 2021, eq. (21) logistic, (30) uniform, (35) Cauchy; the survival function is 1 - F.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

namespace dpr::reference {

/// In the order of dpr::Prior.
enum class Prior { gaussian, cauchy, logistic, gumbel, uniform };
inline constexpr std::array k_priors = {Prior::gaussian, Prior::cauchy, Prior::logistic, Prior::gumbel,
                                        Prior::uniform};

inline constexpr double k_minus_infinity = -std::numeric_limits<double>::infinity();

/// log(1 + exp(x)) without overflow.
inline double log1p_exp(double x) { return x > 0.0 ? x + std::log1p(std::exp(-x)) : std::log1p(std::exp(x)); }

inline double log_density(Prior prior, double x) {
  switch (prior) {
    case Prior::gaussian:
      return -0.5 * x * x - 0.5 * std::log(2.0 * std::numbers::pi);
    case Prior::cauchy:
      return -2.0 * std::log(std::hypot(1.0, x)) - std::log(std::numbers::pi);
    case Prior::logistic:
      return -std::fabs(x) - 2.0 * log1p_exp(-std::fabs(x));
    case Prior::gumbel:
      return -x - std::exp(-x);
    case Prior::uniform:
      return std::fabs(x) < 0.5 ? 0.0 : k_minus_infinity;
  }
  throw std::invalid_argument("log_density: unknown prior");
}

inline double density(Prior prior, double x) { return std::exp(log_density(prior, x)); }

/// f(x) / (1 - F(x)) of the normal distribution for large x by Laplace's continued fraction x + 1/(x + 2/(x +
/// ...)): the quotient of two underflowing numbers is never formed.
inline double gaussian_tail_hazard(double x) {
  constexpr int k_terms = 40;
  double value = x;
  for (int i = k_terms; i >= 1; --i) value = x + i / value;
  return value;
}

/// From here on the normal survival function is computed from the hazard; erfc is accurate up to here and
/// beyond, and only its underflow at 37 and the cancellation of logarithms have to be avoided.
inline constexpr double k_gaussian_tail = 10.0;

/// ln(1 - F(x)), exact to rounding in both tails.
inline double log_survival(Prior prior, double x) {
  switch (prior) {
    case Prior::gaussian:
      if (x > k_gaussian_tail) return log_density(prior, x) - std::log(gaussian_tail_hazard(x));
      if (x < 0.0) return std::log1p(-0.5 * std::erfc(-x / std::numbers::sqrt2));
      return std::log(0.5 * std::erfc(x / std::numbers::sqrt2));
    case Prior::cauchy:
      if (x < 0.0) return std::log1p(-std::atan2(1.0, -x) / std::numbers::pi);
      return std::log(std::atan2(1.0, x) / std::numbers::pi);
    case Prior::logistic:
      return -log1p_exp(x);
    case Prior::gumbel: {
      // 1 - exp(-e) with e = exp(-x); its logarithm is -x - e/2 where e is too small to matter otherwise.
      const double e = std::exp(-x);
      return e < 1e-9 ? -x - 0.5 * e : std::log(-std::expm1(-e));
    }
    case Prior::uniform:
      return std::log(std::clamp(0.5 - x, 0.0, 1.0));
  }
  throw std::invalid_argument("log_survival: unknown prior");
}

/// ln F(x), exact to rounding in both tails.
inline double log_cdf(Prior prior, double x) {
  if (prior == Prior::gumbel) return -std::exp(-x);
  return log_survival(prior, -x);  // the others are symmetric
}

inline double cdf(Prior prior, double x) { return std::exp(log_cdf(prior, x)); }
inline double survival(Prior prior, double x) { return std::exp(log_survival(prior, x)); }

/// f(x) / (1 - F(x)): the derivative of -ln(1 - F). Zero where the uniform prior has nothing left.
inline double hazard(Prior prior, double x) {
  if (prior == Prior::gaussian && x > k_gaussian_tail) return gaussian_tail_hazard(x);
  const double log_f = log_density(prior, x);
  if (log_f == k_minus_infinity) return 0.0;
  return std::exp(log_f - log_survival(prior, x));
}

/// nu'(z) of mu = exp(-nu); the uniform prior has none.
inline double score(Prior prior, double z) {
  switch (prior) {
    case Prior::gaussian:
      return z;
    case Prior::cauchy:
      return 2.0 * z / (1.0 + z * z);
    case Prior::logistic:
      return std::tanh(0.5 * z);
    case Prior::gumbel:
      return -std::expm1(-z);
    case Prior::uniform:
      break;
  }
  throw std::invalid_argument("score: the uniform prior has no score");
}

/// Quadrature panels of a prior, in units of gamma.
struct PanelRule {
  double lower;   ///< F(lower) and the mass below it are negligible
  double upper;   ///< 1 - F(upper) is negligible
  double width;   ///< of the widest panel near a slot
  double growth;  ///< panels at distance d from the nearest slot may be growth * d wide
};

/// Neglected mass: Gaussian 1e-19, Cauchy 3e-15 a slot, logistic and Gumbel 4e-18. Widths hold 16 nodes to
/// 1e-13 and better even for 300 coincident slots, where the uniform product is a polynomial of degree 299.
inline PanelRule panel_rule(Prior prior) {
  switch (prior) {
    case Prior::gaussian:
      return {-9.0, 9.0, 1.5, 0.0};
    case Prior::cauchy:
      return {-1e14, 1e14, 1.5, 1.0};
    case Prior::logistic:
      return {-40.0, 40.0, 2.0, 0.0};
    case Prior::gumbel:
      return {-4.0, 40.0, 1.0, 0.0};
    case Prior::uniform:
      return {-0.5, 0.5, 0.0625, 0.0};
  }
  throw std::invalid_argument("panel_rule: unknown prior");
}

}  // namespace dpr::reference
