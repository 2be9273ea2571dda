// The exact barrier aggregation against the reference: weights, image and every gradient of synthetic pixels, from none
// to 300 fragments, from coincident to far apart, for each prior.
#include <doctest/doctest.h>

#include <array>

#include "support/aggregate_errors.hpp"

namespace {

using dpr::Prior;
using dpr::Smoothing;
using dpr::test::AggregateErrors;
using dpr::test::compare_with_reference;
using dpr::test::SyntheticFrame;
using dpr::test::SyntheticPixel;

struct PriorCase {
  Prior prior;
  std::string_view name;
  double weight, gradient;
};

constexpr std::array<PriorCase, 4> k_cases{{{Prior::gaussian, "gaussian", 5e-6, 5e-5},
                                            {Prior::cauchy, "cauchy", 1e-4, 1e-3},
                                            {Prior::logistic, "logistic", 2e-5, 2e-4},
                                            {Prior::gumbel, "gumbel", 2e-5, 2e-4}}};

Smoothing barrier(Prior prior, float gamma, float alpha) {
  Smoothing smoothing;
  smoothing.depth_prior = prior;
  smoothing.gamma = gamma;
  smoothing.alpha = alpha;
  return smoothing;
}

AggregateErrors all_errors(Prior prior, float distortion) {
  AggregateErrors errors;
  unsigned seed = 1;
  for (const float gamma : {1e-7F, 1e-4F, 1e-2F, 1.0F}) {
    for (const float alpha : {0.5F, 1.0F, 3.0F}) {
      compare_with_reference(dpr::test::make_pixels(gamma, seed++), barrier(prior, gamma, alpha), errors, distortion);
    }
  }
  return errors;
}

}  // namespace

TEST_SUITE("gradient") {
  TEST_CASE("barrier aggregation: weights, image and gradients are the reference's") {
    for (const PriorCase& c : k_cases) {
      CAPTURE(std::string(c.name));
      const AggregateErrors errors = all_errors(c.prior, 1);
      DPR_CHECK_WORST(errors.weight, c.weight);
      DPR_CHECK_WORST(errors.color, c.weight);
      DPR_CHECK_WORST(errors.alpha, 1e-6);
      DPR_CHECK_WORST(errors.grad_depth, c.gradient);
      DPR_CHECK_WORST(errors.grad_log_occupancy, c.gradient);
      DPR_CHECK_WORST(errors.grad_gamma, c.gradient);
      DPR_CHECK_WORST(errors.grad_alpha, c.gradient);
    }
  }
}
