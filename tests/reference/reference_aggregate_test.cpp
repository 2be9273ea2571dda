/// The exact aggregation of the reference renderer: closed forms, limits, and gradients against finite
/// differences, for one to 300 fragments from coincident to far apart.
#include "test_support.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <numeric>
#include <vector>

namespace reference_aggregate_test {

using namespace dpr::reference;

namespace {

FragmentInput fragment(double depth, double occupancy, const Vec3d& color = {}) {
  return {depth, occupancy, std::log(occupancy), color};
}

double total(const AggregateResult& r) {
  return std::accumulate(r.weights.begin(), r.weights.end(), r.background_weight);
}

/// P(Z_0 + delta > Z_1) for two independent draws of the prior.
double two_slot_weight(Prior prior, double delta) {
  switch (prior) {
    case Prior::gaussian:
      return 0.5 * std::erfc(-0.5 * delta);
    case Prior::cauchy:
      return 0.5 + std::atan(0.5 * delta) / std::numbers::pi;
    case Prior::gumbel:
      return 1.0 / (1.0 + std::exp(-delta));
    case Prior::logistic: {  // integral of F(x + delta) f(x): (1 - e + e delta) / (1 - e)^2 with e =
                             // exp(-delta)
      const double e = std::exp(-delta);
      return delta == 0.0 ? 0.5 : (1.0 - e - delta * e) / ((1.0 - e) * (1.0 - e));
    }
    case Prior::uniform: {
      const double rest = std::max(0.0, 1.0 - std::fabs(delta));
      return delta > 0.0 ? 1.0 - 0.5 * rest * rest : 0.5 * rest * rest;
    }
  }
  return 0.0;
}

std::vector<FragmentInput> random_fragments(Random& random, std::size_t count, double spread) {
  std::vector<FragmentInput> fragments;
  for (std::size_t k = 0; k < count; ++k) {
    fragments.push_back(fragment(3.0 + random(0.0, spread), random(0.05, 0.95), random.vector(0.0, 1.0)));
  }
  return fragments;
}

/// Parameters of the finite differences: per fragment depth, occupancy, colour; then gamma, alpha,
/// background.
std::vector<double> pack(const std::vector<FragmentInput>& fragments, const AggregateParameters& p) {
  std::vector<double> at;
  for (const FragmentInput& f : fragments) {
    at.insert(at.end(), {f.depth, f.occupancy});
    append(at, f.color);
  }
  at.insert(at.end(), {p.gamma, p.alpha});
  append(at, p.background);
  return at;
}

double evaluate(const std::vector<double>& at, AggregateParameters p, const Vec3d& grad_color,
                double grad_silhouette) {
  const std::size_t count = (at.size() - 5) / 5;
  std::vector<FragmentInput> fragments;
  for (std::size_t k = 0; k < count; ++k)
    fragments.push_back(fragment(at[5 * k], at[5 * k + 1], take(at, 5 * k + 2)));
  p.gamma = at[5 * count];
  p.alpha = at[5 * count + 1];
  p.background = take(at, 5 * count + 2);
  const AggregateResult r = aggregate_forward(fragments, p);
  return dot(grad_color, r.color) + grad_silhouette * r.silhouette;
}

/// The gradient in the order of `pack`; ln p follows p.
std::vector<double> pack(const std::vector<FragmentInput>& fragments, const AggregateGradient& g) {
  std::vector<double> gradient;
  for (std::size_t k = 0; k < fragments.size(); ++k) {
    const FragmentInputGradient& f = g.fragments[k];
    gradient.insert(gradient.end(), {f.depth, f.occupancy + f.log_occupancy / fragments[k].occupancy});
    append(gradient, f.color);
  }
  gradient.insert(gradient.end(), {g.gamma, g.alpha});
  append(gradient, g.background);
  return gradient;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("aggregate: two slots have closed forms") {
    for (const Prior prior : k_priors) {
      for (const double delta : {-40.0, -2.5, -0.3, 0.0, 0.7, 6.0, 1000.0}) {
        CAPTURE(static_cast<int>(prior));
        CAPTURE(delta);
        const std::vector<double> w = integrate_weights(prior, {{delta, 1.0}, {0.0, 1.0}});
        CHECK(std::fabs(w[0] - two_slot_weight(prior, delta)) < 1e-13);
        CHECK_FALSE(std::fabs(w[1] - two_slot_weight(prior, delta + 0.1)) < 1e-13);
      }
    }
  }

  TEST_CASE("aggregate: weights sum to one for any number, spread and gamma") {
    Random random(5);
    for (const Prior prior : k_priors) {
      for (const Composition composition : k_compositions) {
        for (const std::size_t count : {0U, 1U, 7U, 40U}) {
          for (const double gamma : {1e-7, 1e-4, 1e-2, 1.0}) {
            AggregateParameters p;
            p.prior = prior;
            p.composition = composition;
            p.gamma = gamma;
            const std::vector<FragmentInput> fragments =
                random_fragments(random, count, count == 7 ? 1e-6 : 2.0);
            CAPTURE(static_cast<int>(prior));
            CAPTURE(static_cast<int>(composition));
            CAPTURE(count);
            CAPTURE(gamma);
            CHECK(std::fabs(total(aggregate_forward(fragments, p)) - 1.0) < 1e-10);
          }
        }
      }
    }
  }

  TEST_CASE("aggregate: 300 coincident fragments share alike") {
    for (const Prior prior : k_priors) {
      for (const Composition composition : k_compositions) {
        AggregateParameters p;
        p.prior = prior;
        p.composition = composition;
        p.gamma = 1e-3;
        const AggregateResult r = aggregate_forward(std::vector<FragmentInput>(300, fragment(3.0, 0.5)), p);
        const double share = (1.0 - r.background_weight) / 300.0;
        CAPTURE(static_cast<int>(prior));
        for (const double w : {r.weights.front(), r.weights[150], r.weights.back()}) {
          CHECK(std::fabs(w - share) < 1e-12);
        }
      }
    }
  }

  TEST_CASE("aggregate: far apart the joint composition is the product from front to back") {
    for (const Prior prior : {Prior::gaussian, Prior::logistic, Prior::gumbel, Prior::uniform}) {
      AggregateParameters p;
      p.prior = prior;
      p.composition = Composition::joint;
      p.gamma = 1e-6;
      const AggregateResult r =
          aggregate_forward({fragment(5.0, 0.3), fragment(3.0, 0.9), fragment(4.0, 1.0)}, p);
      CHECK(std::fabs(r.weights[1] - 0.9) < 1e-12);
      CHECK(std::fabs(r.weights[2] - 0.1) < 1e-12);
      CHECK(std::fabs(r.weights[0]) < 1e-12);
      CHECK(r.background_weight == 0.0);
      CHECK(r.silhouette == 1.0);
    }
  }
}

TEST_SUITE("gradient") {
  TEST_CASE("aggregate: quadrature with Gumbel noise is softmax, value and gradient") {
    Random random(4);
    std::vector<Slot> slots;
    std::vector<double> grad_weights;
    for (int k = 0; k < 20; ++k) {
      slots.push_back({random(-6.0, 6.0), 1.0});
      grad_weights.push_back(random(-1.0, 1.0));
    }
    const std::vector<double> quadrature = integrate_weights(Prior::gumbel, slots);
    const std::vector<double> closed = softmax_weights(slots);
    const std::vector<SlotGradient> grad_quadrature =
        integrate_backward(Prior::gumbel, Composition::barrier, slots, grad_weights);
    const std::vector<SlotGradient> grad_closed = softmax_backward(slots, grad_weights);
    for (std::size_t k = 0; k < slots.size(); ++k) {
      CHECK(std::fabs(quadrature[k] - closed[k]) < 1e-13);
      CHECK(std::fabs(grad_quadrature[k].beta - grad_closed[k].beta) < 1e-13);
    }
  }

  TEST_CASE("aggregate: an absent fragment changes nothing and has no gradient") {
    Random random(6);
    for (const Composition composition : k_compositions) {
      AggregateParameters p;
      p.composition = composition;
      std::vector<FragmentInput> fragments = random_fragments(random, 3, 0.5);
      const AggregateResult without = aggregate_forward(fragments, p);
      fragments.insert(fragments.begin() + 1, {3.0, 0.0, k_minus_infinity, {1.0, 1.0, 1.0}});
      const AggregateResult with = aggregate_forward(fragments, p);
      CHECK(with.weights[1] == 0.0);
      CHECK(length(with.color - without.color) < 1e-15);
      const FragmentInputGradient g = aggregate_backward(fragments, p, {1.0, 2.0, 3.0}, 0.5).fragments[1];
      CHECK(g.depth == 0.0);
      CHECK(g.occupancy == 0.0);
      CHECK(g.log_occupancy == 0.0);
    }
  }

  TEST_CASE("aggregate: gradients in both compositions with every prior") {
    Random random(7);
    const Vec3d grad_color = {0.4, -0.9, 0.6};
    for (const Composition composition : k_compositions) {
      for (const Prior prior : k_priors) {
        for (const double gamma : {2e-3, 5e-2, 1.0}) {
          AggregateParameters p;
          p.prior = prior;
          p.composition = composition;
          p.gamma = gamma;
          p.alpha = 1.3;
          p.background = {0.3, 0.1, 0.7};
          p.background_depth = composition == Composition::barrier ? 0.94 : 1e-10;  // close enough to be seen
          const std::vector<FragmentInput> fragments = random_fragments(random, 4, 40.0 * gamma);
          const std::vector<double> at = pack(fragments, p);
          const ScalarFunction f = [&](const std::vector<double>& v) {
            return evaluate(v, p, grad_color, 0.3);
          };
          std::vector<double> gradient = pack(fragments, aggregate_backward(fragments, p, grad_color, 0.3));
          CAPTURE(static_cast<int>(composition));
          CAPTURE(static_cast<int>(prior));
          CAPTURE(gamma);
          // The uniform density jumps: its second derivatives are not continuous, the differences only of
          // first order.
          CHECK_GRADIENT(f, at, gradient, 1e-6, prior == Prior::uniform ? 1e-4 : 1e-6, 1e-9);
          gradient[0] += 1.0;
          CHECK_FALSE(check_gradient(f, at, gradient, 1e-6, 1e-6, 1e-9).passed);
        }
      }
    }
  }

  TEST_CASE("aggregate: gradients where coverage is certain, p = 1") {
    AggregateParameters p;
    p.composition = Composition::joint;
    p.gamma = 1e-2;
    const std::vector<FragmentInput> fragments = {fragment(3.0, 1.0), fragment(3.9, 0.6), fragment(9.0, 1.0)};
    for (const Prior prior : k_priors) {
      p.prior = prior;
      const std::vector<double> weights = {0.3, -0.4, 0.8};
      const AggregateGradient g = weights_backward(fragments, p, weights, 0.2);
      CAPTURE(static_cast<int>(prior));
      for (std::size_t k = 0; k < fragments.size(); ++k) {
        // The expectation is affine in each p: a difference quotient on one side is exact.
        const auto value = [&](double occupancy) {
          std::vector<FragmentInput> changed = fragments;
          changed[k] = fragment(fragments[k].depth, occupancy);
          const AggregateResult r = aggregate_forward(changed, p);
          return std::inner_product(weights.begin(), weights.end(), r.weights.begin(),
                                    0.2 * r.background_weight);
        };
        const double quotient =
            (value(fragments[k].occupancy) - value(0.25)) / (fragments[k].occupancy - 0.25);
        CHECK(std::fabs(g.fragments[k].occupancy - quotient) < 1e-11);
        CHECK_FALSE(std::fabs(g.fragments[k].occupancy - quotient - 1e-3) < 1e-11);
      }
    }
  }
}

}  // namespace reference_aggregate_test
