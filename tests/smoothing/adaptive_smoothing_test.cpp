// The schedule against sequences computed by hand.
#include "dpr/adaptive_smoothing.hpp"

#include <doctest/doctest.h>

#include <limits>
#include <tuple>

#include "dpr/error.hpp"

namespace adaptive_smoothing_test {

namespace {

dpr::Smoothing sampled_smoothing() {
  dpr::Smoothing smoothing = dpr::smoothing_preset("gaussian");
  smoothing.occupancy_estimator = smoothing.aggregation_estimator = dpr::Estimator::monte_carlo;
  return smoothing;
}

/// A schedule that checks in every iteration.
dpr::AdaptiveSchedule eager() { return {.start = 0, .interval = 1}; }

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("the average remembers nine tenths") {
    dpr::AdaptiveSmoothing adaptive;
    dpr::Smoothing smoothing = dpr::smoothing_preset("gaussian");
    double learning_rate = 1;
    adaptive.update(0, 2.0, smoothing, learning_rate);
    CHECK(adaptive.average() == doctest::Approx(0.2).epsilon(1e-6));
    adaptive.update(1, -1.0, smoothing, learning_rate);
    CHECK(adaptive.average() == doctest::Approx(0.08).epsilon(1e-6));
  }

  TEST_CASE("the published schedule changes at 100, 150, ... and nowhere else") {
    dpr::AdaptiveSmoothing adaptive;
    dpr::Smoothing smoothing = sampled_smoothing();
    double learning_rate = 5e-2;
    for (unsigned i = 0; i < 240; ++i) {
      CHECK(adaptive.update(i, 1.0, smoothing, learning_rate) == (i == 100 || i == 150 || i == 200));
    }
    CHECK(smoothing.sigma == doctest::Approx(1e-3 / 1.331));
    CHECK(smoothing.gamma == doctest::Approx(1e-2 / 1.331));
    CHECK(smoothing.samples == 64);
    CHECK(learning_rate == doctest::Approx(5e-2 / 3.375));
  }

  TEST_CASE("nothing shrinks while more smoothing means less loss") {
    dpr::AdaptiveSmoothing adaptive(eager());
    dpr::Smoothing smoothing = sampled_smoothing();
    double learning_rate = 1;
    CHECK_FALSE(adaptive.update(0, -1.0, smoothing, learning_rate));
    CHECK_FALSE(adaptive.update(1, 0.5, smoothing, learning_rate));  // the average is still negative
    CHECK(smoothing.sigma == dpr::smoothing_preset("gaussian").sigma);
    CHECK(learning_rate == 1);
    CHECK(adaptive.update(2, 2.0, smoothing, learning_rate));
  }

  TEST_CASE("floors and the cap hold, and then there is no change to report") {
    dpr::AdaptiveSmoothing adaptive(eager());
    dpr::Smoothing smoothing = sampled_smoothing();
    double learning_rate = 5e-2;
    unsigned changes = 0;
    for (unsigned i = 0; i < 200; ++i) changes += adaptive.update(i, 1.0, smoothing, learning_rate) ? 1 : 0;
    CHECK(smoothing.sigma == 5e-5F);
    CHECK(smoothing.gamma == 5e-4F);
    CHECK(smoothing.samples == 128);
    CHECK(learning_rate == doctest::Approx(1e-4));
    CHECK(changes == 32);  // ln 20 / ln 1.1 = 31.4
  }

  TEST_CASE("what starts below a floor or above the cap stays there") {
    dpr::AdaptiveSmoothing adaptive(eager());
    dpr::Smoothing smoothing = sampled_smoothing();
    smoothing.sigma = 1e-5F;
    smoothing.samples = 1000;
    double learning_rate = 1e-5;
    CHECK(adaptive.update(0, 1.0, smoothing, learning_rate));
    CHECK(smoothing.sigma == 1e-5F);
    CHECK(smoothing.samples == 1000);
    CHECK(learning_rate == 1e-5);
  }

  TEST_CASE("every member of the family stays valid while it adapts") {
    using enum dpr::VarianceReduction;
    using dpr::Draws;
    dpr::Smoothing softras = dpr::smoothing_preset("softras");
    double rate = 1;
    CHECK(dpr::AdaptiveSmoothing(eager()).update(0, 1.0, softras, rate));
    CHECK_NOTHROW(validate(softras));
    CHECK(*softras.blur_radius == doctest::Approx(9.2102404e-3 / 1.1));
    for (const auto& [reduction, draws, samples] :
         {std::tuple{leave_one_out, Draws::independent, 2U}, std::tuple{leave_one_out, Draws::antithetic, 4U},
          std::tuple{rigid, Draws::antithetic, 2U}, std::tuple{none, Draws::stratified, 3U}}) {
      dpr::AdaptiveSchedule schedule = eager();
      schedule.max_samples = 101;
      dpr::AdaptiveSmoothing adaptive(schedule);
      dpr::Smoothing smoothing = sampled_smoothing();
      smoothing.variance_reduction = reduction;
      smoothing.draws = draws;
      smoothing.samples = samples;
      double learning_rate = 1;
      for (unsigned i = 0; i < 10; ++i) {
        adaptive.update(i, 1.0, smoothing, learning_rate);
        CHECK_NOTHROW(validate(smoothing));
      }
      CHECK(smoothing.samples == (draws == Draws::antithetic ? 100 : 101));
    }
  }

  TEST_CASE("a given blur radius shrinks with sigma; the exact estimator keeps its samples") {
    dpr::AdaptiveSmoothing adaptive(eager());
    dpr::Smoothing smoothing = dpr::smoothing_preset("gaussian");
    smoothing.blur_radius = 9e-3F;
    double learning_rate = 1;
    CHECK(adaptive.update(0, 1.0, smoothing, learning_rate));
    CHECK(*smoothing.blur_radius == doctest::Approx(9e-3 / 1.1));
    CHECK(smoothing.samples == dpr::smoothing_preset("gaussian").samples);

    dpr::Smoothing without = dpr::smoothing_preset("gaussian");
    CHECK(adaptive.update(1, 1.0, without, learning_rate));
    CHECK_FALSE(without.blur_radius.has_value());
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("schedules out of range are errors") {
    for (const dpr::AdaptiveSchedule& wrong :
         {dpr::AdaptiveSchedule{.interval = 0}, dpr::AdaptiveSchedule{.rate = 1},
          dpr::AdaptiveSchedule{.sigma_floor = 0}, dpr::AdaptiveSchedule{.gamma_floor = -1},
          dpr::AdaptiveSchedule{.max_samples = 0}, dpr::AdaptiveSchedule{.max_samples = (1U << 20) + 1},
          dpr::AdaptiveSchedule{.learning_rate_divisor = 0.9F},
          dpr::AdaptiveSchedule{.learning_rate_floor = 0}, dpr::AdaptiveSchedule{.memory = 1}}) {
      CHECK_THROWS_AS(dpr::AdaptiveSmoothing{wrong}, dpr::InvalidArgument);
    }
  }

  TEST_CASE("a gradient that is not finite is an error") {
    dpr::AdaptiveSmoothing adaptive;
    dpr::Smoothing smoothing = dpr::smoothing_preset("gaussian");
    double learning_rate = 1;
    CHECK_THROWS_AS(adaptive.update(0, std::numeric_limits<double>::infinity(), smoothing, learning_rate),
                    dpr::InvalidArgument);
  }
}

}  // namespace adaptive_smoothing_test
