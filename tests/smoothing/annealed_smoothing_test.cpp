// The fixed schedule from coarse to fine.
#include <doctest/doctest.h>

#include <cmath>

#include "dpr/annealed_smoothing.hpp"
#include "dpr/error.hpp"

namespace annealed_smoothing_test {

namespace {

dpr::Smoothing start() {
  dpr::Smoothing smoothing = dpr::smoothing_preset("gaussian");
  smoothing.sigma = 1e-2F;
  smoothing.gamma = 1e-2F;
  return smoothing;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("annealing falls geometrically from the start to the end values") {
    const dpr::AnnealSchedule schedule{
        .levels = 3, .sigma_end = 1e-4F, .gamma_end = 1e-3F, .learning_rate_end = 1e-3};
    dpr::Smoothing smoothing = start();
    smoothing.blur_radius = 2e-2F;
    double learning_rate = 1e-1;
    const dpr::AnnealedSmoothing annealed(schedule, 30, smoothing, learning_rate);

    for (unsigned i = 0; i < 9; ++i) CHECK_FALSE(annealed.update(i, smoothing, learning_rate));
    CHECK(smoothing.sigma == 1e-2F);
    CHECK(annealed.update(9, smoothing, learning_rate));
    CHECK(smoothing.sigma == doctest::Approx(1e-3));
    CHECK(smoothing.gamma == doctest::Approx(1e-2 / std::sqrt(10.0)));
    CHECK(learning_rate == doctest::Approx(1e-2));
    CHECK(*smoothing.blur_radius == doctest::Approx(2e-3));
    for (unsigned i = 10; i < 19; ++i) CHECK_FALSE(annealed.update(i, smoothing, learning_rate));
    CHECK(annealed.update(19, smoothing, learning_rate));
    CHECK(smoothing.sigma == doctest::Approx(1e-4));
    CHECK(smoothing.gamma == doctest::Approx(1e-3));
    CHECK(learning_rate == doctest::Approx(1e-3));
    for (unsigned i = 20; i < 40; ++i) CHECK_FALSE(annealed.update(i, smoothing, learning_rate));
  }

  TEST_CASE("annealing never raises what starts below its end value") {
    dpr::Smoothing smoothing = start();
    smoothing.sigma = 1e-7F;
    double learning_rate = 1e-5;
    const dpr::AnnealedSmoothing annealed({.levels = 2}, 2, smoothing, learning_rate);
    CHECK(annealed.update(0, smoothing, learning_rate));
    CHECK(smoothing.sigma == 1e-7F);
    CHECK(learning_rate == 1e-5);
    CHECK(smoothing.gamma == doctest::Approx(1e-3));
  }

  TEST_CASE("a reach that is no number of sigmas stays") {
    dpr::Smoothing smoothing = dpr::smoothing_preset("nmr");
    double learning_rate = 1;
    const dpr::AnnealedSmoothing annealed({.levels = 2, .sigma_end = 1e-4F}, 2, smoothing, learning_rate);
    CHECK(annealed.update(0, smoothing, learning_rate));
    CHECK(smoothing.sigma == doctest::Approx(1e-4));
    CHECK(smoothing.blur_radius == 0.5F);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("annealing refuses a schedule out of range") {
    for (const dpr::AnnealSchedule& schedule :
         {dpr::AnnealSchedule{.levels = 0}, dpr::AnnealSchedule{.sigma_end = 0},
          dpr::AnnealSchedule{.gamma_end = -1}, dpr::AnnealSchedule{.learning_rate_end = 0}}) {
      CHECK_THROWS_AS(dpr::AnnealedSmoothing(schedule, 10, start(), 1e-2), dpr::InvalidArgument);
    }
    CHECK_THROWS_AS(dpr::AnnealedSmoothing({}, 0, start(), 1e-2), dpr::InvalidArgument);
  }
}

}  // namespace annealed_smoothing_test
