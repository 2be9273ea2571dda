/// Nodes for the integrals of the exact aggregation over the whole line (aggregate.hpp).
///
/// Composite Gauss-Legendre on panels that follow every slot: all mass of slot k lies at beta_k + [lower,
/// upper]. Cauchy panels grow with the distance to the nearest slot, so that tails of any length cost a
/// logarithmic number of them; uniform panels end where a density jumps.
#pragma once

#include "priors.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

namespace dpr::reference {

/// The node lies at anchor + offset, anchor being the beta of the nearest slot: t - beta_k is then formed
/// from a difference of betas and a small number, and loses nothing however far apart the slots are.
struct Node {
  double anchor = 0.0;
  double offset = 0.0;
  double weight = 0.0;
};

struct GaussLegendre {
  std::vector<double> node;  ///< in (-1, 1)
  std::vector<double> weight;
};

/// Roots of the Legendre polynomial of degree `n` by Newton's method from Chebyshev's points.
inline GaussLegendre gauss_legendre(int n) {
  GaussLegendre rule;
  for (int i = 0; i < n; ++i) {
    double x = std::cos(std::numbers::pi * (i + 0.75) / (n + 0.5));
    double derivative = 1.0;
    for (int iteration = 0; iteration < 10; ++iteration) {
      double previous = 1.0;
      double value = x;
      for (int k = 2; k <= n; ++k) {
        const double next = ((2.0 * k - 1.0) * x * value - (k - 1.0) * previous) / k;
        previous = value;
        value = next;
      }
      derivative = n * (x * value - previous) / (x * x - 1.0);
      x -= value / derivative;
    }
    rule.node.push_back(x);
    rule.weight.push_back(2.0 / ((1.0 - x * x) * derivative * derivative));
  }
  return rule;
}

inline double nearest_beta(const std::vector<double>& sorted_betas, double t) {
  const auto above = std::lower_bound(sorted_betas.begin(), sorted_betas.end(), t);
  if (above == sorted_betas.begin()) return *above;
  const auto below = above - 1;
  if (above == sorted_betas.end()) return *below;
  return *above - t < t - *below ? *above : *below;
}

/// Halves [a, b] until every panel is narrow enough for its distance to the nearest slot.
inline void append_panels(const PanelRule& rule, const std::vector<double>& sorted_betas, double a, double b,
                          std::vector<Node>& nodes) {
  static const GaussLegendre k_rule = gauss_legendre(16);
  const double center = 0.5 * (a + b);
  const double half = 0.5 * (b - a);
  if (!(a < center && center < b)) return;  // adjacent numbers: an interval without measure
  const double anchor = nearest_beta(sorted_betas, center);
  const double gap = std::max(0.0, std::fabs(center - anchor) - half);
  if (2.0 * half > std::max(rule.width, rule.growth * gap)) {
    append_panels(rule, sorted_betas, a, center, nodes);
    append_panels(rule, sorted_betas, center, b, nodes);
    return;
  }
  for (std::size_t i = 0; i < k_rule.node.size(); ++i) {
    nodes.push_back({anchor, center - anchor + half * k_rule.node[i], half * k_rule.weight[i]});
  }
}

/// Nodes for slots at `betas`, which has at least one element. Below `floor` the integrand is negligible.
inline std::vector<Node> quadrature_nodes(Prior prior, std::vector<double> betas, double floor) {
  std::sort(betas.begin(), betas.end());
  const PanelRule rule = panel_rule(prior);
  // Between two neighbouring ends of slots' intervals every slot is either active or not.
  std::vector<double> ends;
  for (double beta : betas) {
    ends.push_back(std::max(floor, beta + rule.lower));
    ends.push_back(std::max(floor, beta + rule.upper));
  }
  std::sort(ends.begin(), ends.end());
  std::vector<Node> nodes;
  for (std::size_t i = 0; i + 1 < ends.size(); ++i) {
    const double center = 0.5 * (ends[i] + ends[i + 1]);
    const bool covered = std::any_of(betas.begin(), betas.end(), [&](double beta) {
      return center - beta > rule.lower && center - beta < rule.upper;
    });
    if (covered) append_panels(rule, betas, ends[i], ends[i + 1], nodes);
  }
  return nodes;
}

}  // namespace dpr::reference
