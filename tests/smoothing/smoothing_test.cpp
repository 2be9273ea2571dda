// The smoothing: how far it reaches, its named members, its words, its checks.
#include "dpr/smoothing.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "reference/priors.hpp"
#include "smoothing/priors.hpp"
#include "support/messages.hpp"

namespace smoothing_test {

using namespace dpr;

namespace {

constexpr float k_nan = std::numeric_limits<float>::quiet_NaN();

// p = 1 - F(-s / sigma) at s = -x sigma, MATHS sections 2 and 4.1.
double occupancy_outside(Prior prior, double x) {
  switch (prior) {
    case Prior::gaussian:
      return 0.5 * std::erfc(x / std::numbers::sqrt2);
    case Prior::cauchy:
      return std::atan2(1.0, x) / std::numbers::pi;
    case Prior::logistic:
      return 1 / (1 + std::exp(x));
    case Prior::gumbel:
      return -std::expm1(-std::exp(-x));
    case Prior::uniform:
      return std::max(0.5 - x, 0.0);
  }
  return 0;
}

double reach(Prior prior, float threshold) {
  Smoothing smoothing = smoothing_preset("gaussian");
  smoothing.occupancy_prior = prior;
  smoothing.occupancy_threshold = threshold;
  smoothing.sigma = 1;
  return static_cast<double>(blur_radius(smoothing));
}

/// P(Z1 - Z2 > apart), by the trapezoidal rule.
double probability_of_difference(reference::Prior prior, double apart) {
  constexpr double k_step = 1e-3, k_end = 60;
  double sum = 0;
  for (double x = -k_end; x < k_end; x += k_step)
    sum += reference::density(prior, x) * std::exp(reference::log_survival(prior, x + apart));
  return k_step * sum;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("what is hidden is in front once in a billion times") {
    for (const Prior prior : choices<Prior>()) {
      const double behind = row_of(prior).hidden_behind;
      CAPTURE(to_string(prior));
      if (prior == Prior::cauchy) {
        CHECK(behind == std::numeric_limits<double>::infinity());
        continue;
      }
      const auto its = static_cast<reference::Prior>(prior);
      CHECK(probability_of_difference(its, behind) < 1e-9);
      CHECK(probability_of_difference(its, 0.98 * behind) > (prior == Prior::uniform ? 0 : 1e-9));
    }
  }

  TEST_CASE("the blur radius is where the occupancy falls to the threshold") {
    for (const Prior prior : choices<Prior>()) {
      for (const float threshold : {0.49F, 0.1F, 4e-3F, 1e-4F, 1e-12F, 1e-38F}) {
        if (prior == Prior::cauchy && threshold < 4e-3F) continue;  // capped, see below
        const double p = occupancy_outside(prior, reach(prior, threshold));
        // The radius is a float: its rounding is as large as this in p.
        const double tolerance = prior == Prior::uniform ? 1e-7 : 1e-5 * static_cast<double>(threshold);
        CHECK_MESSAGE(std::abs(p - static_cast<double>(threshold)) <= tolerance,
                      to_string(prior) << " at " << threshold << ": p " << p);
      }
    }
    CHECK(reach(Prior::gaussian, 1e-4F) == doctest::Approx(3.7190165).epsilon(1e-6));
    CHECK(reach(Prior::logistic, 1e-4F) == doctest::Approx(9.2102404).epsilon(1e-6));
    CHECK(reach(Prior::gumbel, 1e-4F) == doctest::Approx(9.2102904).epsilon(1e-6));
    CHECK(reach(Prior::uniform, 1e-4F) == doctest::Approx(0.4999).epsilon(1e-6));
  }

  TEST_CASE("Cauchy's radius is capped at 100 sigma") {
    CHECK(reach(Prior::cauchy, 1e-4F) == 100);
    CHECK(occupancy_outside(Prior::cauchy, 100) == doctest::Approx(3.18e-3).epsilon(1e-3));
    CHECK(reach(Prior::cauchy, 0.01F) < 32);
  }

  TEST_CASE("the blur radius follows sigma, unless it is given") {
    Smoothing smoothing = smoothing_preset("gaussian");
    const float at_default = blur_radius(smoothing);
    smoothing.sigma *= 2;
    CHECK(blur_radius(smoothing) == doctest::Approx(2 * at_default));
    smoothing.blur_radius = 0.25F;
    CHECK(blur_radius(smoothing) == 0.25F);
  }

  TEST_CASE("presets") {
    CHECK(smoothing_preset_names().size() == 9);
    for (const std::string_view name : smoothing_preset_names())
      CHECK_NOTHROW(validate(smoothing_preset(name)));
    const Smoothing softras = smoothing_preset("softras");
    CHECK(softras.occupancy_prior == Prior::logistic);
    CHECK(softras.depth_prior == Prior::gumbel);
    CHECK(softras.composition == Composition::barrier);
    CHECK(softras.occupancy_estimator == Estimator::exact);
    CHECK(softras.aggregation_estimator == Estimator::exact);
    for (const bool is_cauchy : {false, true}) {
      const Smoothing paper = smoothing_preset(is_cauchy ? "paper_cauchy" : "paper_gaussian");
      CHECK(paper.occupancy_prior == (is_cauchy ? Prior::cauchy : Prior::gaussian));
      CHECK(paper.depth_prior == paper.occupancy_prior);
      CHECK(paper.occupancy_estimator == Estimator::monte_carlo);
      CHECK(paper.aggregation_estimator == Estimator::monte_carlo);
      CHECK(paper.samples == 8);
      CHECK(paper.variance_reduction == VarianceReduction::rigid);
      CHECK(paper.sigma == 1e-3F);
      CHECK(paper.gamma == 1e-2F);
      CHECK(blur_radius(paper) == doctest::Approx(9.21e-3).epsilon(1e-4));
    }
    const Smoothing opendr = smoothing_preset("opendr");
    CHECK(opendr.occupancy_prior == Prior::uniform);
    CHECK(opendr.distance == DistanceMetric::euclidean);
    CHECK(opendr.sigma == 2.0F / 128);  // a pixel of the default size
    CHECK(smoothing_preset("opendr", 300, 200).sigma == 0.01F);
    CHECK(blur_radius(opendr) == doctest::Approx(opendr.sigma / 2).epsilon(1e-3));
    const Smoothing nmr = smoothing_preset("nmr", 300, 200);
    CHECK(nmr.occupancy_prior == Prior::uniform);
    CHECK(nmr.occupancy_width == OccupancyWidth::variable);
    CHECK(nmr.distance == DistanceMetric::euclidean);
    CHECK(nmr.sigma == 1e-3F);
    CHECK(blur_radius(nmr) == 0.5F);
    for (const bool is_joint : {false, true}) {
      const Smoothing gaussian = smoothing_preset(is_joint ? "joint_gaussian" : "gaussian");
      CHECK(gaussian.composition == (is_joint ? Composition::joint : Composition::barrier));
      CHECK(gaussian.occupancy_prior == Prior::gaussian);
      CHECK(gaussian.depth_prior == Prior::gaussian);
      CHECK(gaussian.occupancy_estimator == Estimator::exact);
      CHECK(gaussian.aggregation_estimator == Estimator::exact);
    }
    const Smoothing rigid = smoothing_preset("rigid");
    CHECK(rigid.composition == Composition::joint);
    CHECK(rigid.occupancy_width == OccupancyWidth::zero);
    CHECK(rigid.gamma == 1e-9F);
    CHECK(blur_radius(rigid) == 0);
  }

  TEST_CASE("words are read as they are written") {
    const auto check = []<typename Choice>(Choice first, std::size_t count) {
      const std::vector<Choice> all = choices<Choice>();
      CHECK(all.size() == count);
      CHECK(all.front() == first);
      for (std::size_t i = 0; i < all.size(); ++i) {
        CHECK(static_cast<std::size_t>(all[i]) == i);
        CHECK_FALSE(to_string(all[i]).empty());
        CHECK(parse_choice<Choice>(to_string(all[i]), "x") == all[i]);
      }
    };
    check(Prior::gaussian, 5);
    check(Composition::barrier, 2);
    check(Estimator::exact, 2);
    check(VarianceReduction::none, 3);
    check(Draws::independent, 3);
    check(DistanceMetric::squared, 2);
    check(OccupancyWidth::fixed, 3);
    CHECK(to_string(Estimator::monte_carlo) == "monte_carlo");
    CHECK(to_string(static_cast<Prior>(99)).empty());
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("values out of range") {
    const auto check = [](auto change, const std::string& part) {
      Smoothing smoothing = smoothing_preset("gaussian");
      change(smoothing);
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(smoothing), part);
    };
    for (const float bad : {0.0F, -1e-3F, k_nan, std::numeric_limits<float>::infinity()}) {
      check([bad](Smoothing& s) { s.sigma = bad; }, "sigma (smoothing): got ");
      check([bad](Smoothing& s) { s.gamma = bad; }, "gamma (smoothing): got ");
      check([bad](Smoothing& s) { s.alpha = bad; }, "alpha (smoothing): got ");
    }
    for (const std::uint32_t bad : {0U, (1U << 20U) + 1U}) {
      check([bad](Smoothing& s) { s.samples = bad; }, "samples (smoothing): got ");
    }
    for (const float bad : {0.0F, 0.5F, k_nan}) {
      check([bad](Smoothing& s) { s.occupancy_threshold = bad; }, "occupancy_threshold (smoothing): got ");
    }
    for (const float bad : {-1.0F, k_nan}) {
      check([bad](Smoothing& s) { s.blur_radius = bad; }, "blur_radius (smoothing): got ");
    }
    check([](Smoothing& s) { s.background_depth = k_nan; }, "background_depth (smoothing): got nan");
    check([](Smoothing& s) { s.depth_prior = static_cast<Prior>(9); }, "depth_prior (smoothing): got 9");
  }

  TEST_CASE("what has no estimator") {
    Smoothing smoothing = smoothing_preset("gaussian");
    smoothing.occupancy_prior = Prior::uniform;
    CHECK_NOTHROW(validate(smoothing));
    smoothing.aggregation_estimator = Estimator::monte_carlo;  // of the Gaussian depth prior
    CHECK_NOTHROW(validate(smoothing));
    smoothing.occupancy_estimator = Estimator::monte_carlo;
    DPR_CHECK_MESSAGE_HAS(
        InvalidArgument, validate(smoothing),
        "occupancy_estimator (smoothing): got monte_carlo with the uniform prior, expected exact");
    smoothing = smoothing_preset("gaussian");
    smoothing.depth_prior = Prior::uniform;
    smoothing.aggregation_estimator = Estimator::monte_carlo;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(smoothing), "aggregation_estimator (smoothing)");
    smoothing = smoothing_preset("joint_gaussian");
    smoothing.aggregation_estimator = Estimator::monte_carlo;
    DPR_CHECK_MESSAGE_HAS(
        InvalidArgument, validate(smoothing),
        "aggregation_estimator (smoothing): got monte_carlo beside an exact stage in the joint");
    smoothing.occupancy_estimator = Estimator::monte_carlo;
    CHECK_NOTHROW(validate(smoothing));
    smoothing.aggregation_estimator = Estimator::exact;
    DPR_CHECK_MESSAGE_HAS(
        InvalidArgument, validate(smoothing),
        "occupancy_estimator (smoothing): got monte_carlo beside an exact stage in the joint");
    smoothing = smoothing_preset("joint_gaussian");
    for (const Prior prior : {Prior::cauchy, Prior::uniform}) {
      smoothing.depth_prior = prior;
      CHECK_NOTHROW(validate(smoothing));
    }
    smoothing.depth_prior = Prior::cauchy;
    smoothing.occupancy_estimator = smoothing.aggregation_estimator = Estimator::monte_carlo;
    CHECK_NOTHROW(validate(smoothing));
    smoothing.occupancy_prior = Prior::uniform;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(smoothing), "monte_carlo with the uniform prior");
  }

  TEST_CASE("baselines, draws and numbers of samples that do not go together") {
    const auto sampled = [](VarianceReduction reduction, Draws draws, std::uint32_t samples) {
      Smoothing smoothing = smoothing_preset("paper_gaussian");
      smoothing.variance_reduction = reduction;
      smoothing.draws = draws;
      smoothing.samples = samples;
      return smoothing;
    };
    using enum VarianceReduction;
    for (const VarianceReduction reduction : {none, rigid}) {
      CHECK_NOTHROW(validate(sampled(reduction, Draws::independent, 1)));
      CHECK_NOTHROW(validate(sampled(reduction, Draws::stratified, 1)));
      CHECK_NOTHROW(validate(sampled(reduction, Draws::antithetic, 2)));
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(sampled(reduction, Draws::antithetic, 7)),
                            "samples (smoothing): got 7 with antithetic draws, expected an even number");
    }
    CHECK_NOTHROW(validate(sampled(leave_one_out, Draws::independent, 2)));
    CHECK_NOTHROW(validate(sampled(leave_one_out, Draws::antithetic, 4)));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(sampled(leave_one_out, Draws::independent, 1)),
                          "samples (smoothing): got 1 with leave_one_out, expected at least 2");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(sampled(leave_one_out, Draws::antithetic, 2)),
                          "samples (smoothing): got 2 with leave_one_out, expected at least 4");
    DPR_CHECK_MESSAGE_HAS(
        InvalidArgument, validate(sampled(leave_one_out, Draws::stratified, 8)),
        "variance_reduction (smoothing): got leave_one_out (the default) with stratified draws");
    Smoothing gumbel = sampled(none, Draws::antithetic, 8);
    gumbel.depth_prior = Prior::gumbel;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(gumbel),
                          "draws (smoothing): got antithetic with the gumbel");
    gumbel.aggregation_estimator = Estimator::exact;  // what is not sampled may be of any prior
    CHECK_NOTHROW(validate(gumbel));
    Smoothing exact = sampled(leave_one_out, Draws::stratified, 1);  // and has no draws
    exact.occupancy_estimator = exact.aggregation_estimator = Estimator::exact;
    CHECK_NOTHROW(validate(exact));
    exact.draws = static_cast<Draws>(9);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(exact),
                          "draws (smoothing): got 9, expected independent,");
  }

  TEST_CASE("a variable width needs what makes the image rigid") {
    const auto check = [](auto change, const std::string& part) {
      Smoothing smoothing = smoothing_preset("nmr");
      change(smoothing);
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(smoothing),
                            "occupancy_width (smoothing): got variable with " + part);
    };
    check([](Smoothing& s) { s.occupancy_prior = Prior::gaussian; }, "another prior");
    check([](Smoothing& s) { s.occupancy_estimator = Estimator::monte_carlo; }, "monte_carlo");
    check([](Smoothing& s) { s.distance = DistanceMetric::squared; }, "squared distances");
    check([](Smoothing& s) { s.composition = Composition::barrier; }, "the barrier");
    check([](Smoothing& s) { s.blur_radius.reset(); }, "no blur_radius");
    Smoothing smoothing = smoothing_preset("gaussian");
    smoothing = smoothing_preset("rigid");
    smoothing.occupancy_estimator = smoothing.aggregation_estimator = Estimator::monte_carlo;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(smoothing),
                          "occupancy_width (smoothing): got zero with monte_carlo");
    smoothing.occupancy_width = static_cast<OccupancyWidth>(7);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(smoothing), "occupancy_width (smoothing): got 7");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, smoothing_preset("opendr", 0, 5), "size (preset): got 0x5");
  }

  TEST_CASE("noise of the pixel goes with what has a meaning there") {
    const auto check = [](auto change, const std::string& part) {
      Smoothing smoothing = smoothing_preset("pixel");
      change(smoothing);
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(smoothing), part);
    };
    check(
        [](Smoothing& s) {
          s.aggregation_estimator = Estimator::monte_carlo;
          s.depth_prior = Prior::uniform;
        },
        "aggregation_estimator (smoothing): got monte_carlo with the uniform prior");
    check([](Smoothing& s) { s.occupancy_prior = Prior::gumbel; },
          "got pixel with the gumbel occupancy_prior");
    check([](Smoothing& s) { s.occupancy_width = OccupancyWidth::zero; },
          "got pixel with occupancy_width zero");
    check([](Smoothing& s) { s.blur_radius = 0.1F; }, "got pixel with a blur_radius");
    check([](Smoothing& s) { s.supersampling = 3; }, "supersampling (smoothing): got 3, expected 1, 2 or 4");
    check([](Smoothing& s) { s.noise = static_cast<Noise>(5); },
          "noise (smoothing): got 5, expected triangle or pixel");
    Smoothing smoothing = smoothing_preset("gaussian");
    smoothing.supersampling = 2;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(smoothing),
                          "supersampling (smoothing): got 2, expected 1, or noise of the pixel");
    smoothing.noise = Noise::pixel;
    CHECK_NOTHROW(validate(smoothing));
    for (const Prior prior : {Prior::cauchy, Prior::logistic, Prior::uniform}) {
      smoothing.occupancy_prior = smoothing.depth_prior = prior;
      CHECK_NOTHROW(validate(smoothing));
    }
    smoothing.occupancy_estimator = Estimator::monte_carlo;  // of the uniform prior, in either composition
    CHECK_NOTHROW(validate(smoothing));
    smoothing.composition = Composition::joint;
    CHECK_NOTHROW(validate(smoothing));
  }

  TEST_CASE("unknown words") {
    DPR_CHECK_MESSAGE_HAS(
        InvalidArgument, parse_choice<Prior>("normal", "depth_prior (S.json)"),
        "depth_prior (S.json): got \"normal\", expected gaussian, cauchy, logistic, gumbel or");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, parse_choice<Estimator>("", "x"), "expected exact or monte_carlo");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, smoothing_preset("SoftRas"),
                          "preset (smoothing): got \"SoftRas\"");
  }
}

}  // namespace smoothing_test
