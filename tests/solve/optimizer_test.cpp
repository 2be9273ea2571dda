// Adam and SGD against sequences computed by hand.
#include "dpr/optimizer.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <limits>

#include "dpr/error.hpp"

namespace optimizer_test {

namespace {

double step_of(dpr::Optimizer& optimizer, double gradient) {
  return optimizer.step(std::array{gradient}).front();
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("Adam's first step is the learning rate against the sign, whatever the scale") {
    dpr::Optimizer adam({.learning_rate = 0.05});
    const auto step = adam.step(std::array{3.0, -2e-3, 0.0});
    REQUIRE(step.size() == 3);
    CHECK(step[0] == doctest::Approx(-0.05).epsilon(1e-7));
    CHECK(step[1] == doctest::Approx(0.05).epsilon(1e-5));
    CHECK(step[2] == 0.0);
  }

  TEST_CASE("Adam's second step, by hand") {
    dpr::Optimizer adam({.learning_rate = 0.1, .beta1 = 0.9, .beta2 = 0.99, .epsilon = 1e-8});
    step_of(adam, 1.0);
    // m = 0.9 * 0.1 + 0.1 * (-2) = -0.11, v = 0.99 * 0.01 + 0.01 * 4 = 0.0499,
    // corrected by 1 - 0.81 = 0.19 and 1 - 0.9801 = 0.0199
    const double expected = -0.1 * (-0.11 / 0.19) / (std::sqrt(0.0499 / 0.0199) + 1e-8);
    CHECK(step_of(adam, -2.0) == doctest::Approx(expected).epsilon(1e-12));
  }

  TEST_CASE("SGD gathers momentum") {
    dpr::Optimizer sgd({.kind = dpr::OptimizerKind::sgd, .learning_rate = 0.5, .beta1 = 0.9});
    CHECK(step_of(sgd, 1.0) == doctest::Approx(-0.5));
    CHECK(step_of(sgd, 1.0) == doctest::Approx(-0.95));
    CHECK(step_of(sgd, -2.0) == doctest::Approx(-0.5 * (0.9 * 1.9 - 2.0)));
  }

  TEST_CASE("restart forgets the moments, and the learning rate stays") {
    dpr::Optimizer adam({.learning_rate = 0.1});
    const double first = step_of(adam, 0.7);
    const double second = step_of(adam, -0.1);
    adam.set_learning_rate(0.2);
    adam.restart();
    CHECK(adam.learning_rate() == 0.2);
    CHECK(step_of(adam, 0.7) == doctest::Approx(2 * first));
    CHECK(step_of(adam, -0.1) == doctest::Approx(2 * second));
    adam.restart();
    CHECK(adam.step(std::array{1.0, 1.0}).size() == 2);
  }

  TEST_CASE("Adam finds the minimum of a badly scaled bowl") {
    dpr::Optimizer adam({.learning_rate = 0.05});
    std::array x{2.0, -1.0};
    for (int i = 0; i < 2000; ++i) {
      const auto step = adam.step(std::array{2e3 * (x[0] - 1), 2e-2 * (x[1] - 3)});
      for (std::size_t k = 0; k < x.size(); ++k) x[k] += step[k];
    }
    CHECK(x[0] == doctest::Approx(1).epsilon(1e-3));
    CHECK(x[1] == doctest::Approx(3).epsilon(1e-3));
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("options out of range are errors") {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    for (const dpr::OptimizerOptions& wrong :
         {dpr::OptimizerOptions{.learning_rate = 0}, dpr::OptimizerOptions{.learning_rate = nan},
          dpr::OptimizerOptions{.beta1 = 1}, dpr::OptimizerOptions{.beta1 = -0.1},
          dpr::OptimizerOptions{.beta2 = 1}, dpr::OptimizerOptions{.beta2 = nan},
          dpr::OptimizerOptions{.epsilon = 0}}) {
      CHECK_THROWS_AS(dpr::Optimizer{wrong}, dpr::InvalidArgument);
    }
    dpr::Optimizer adam({});
    CHECK_THROWS_AS(adam.set_learning_rate(-1), dpr::InvalidArgument);
  }

  TEST_CASE("a gradient of another length or with a nan is an error and changes nothing") {
    dpr::Optimizer adam({}), undisturbed({});
    adam.step(std::array{1.0});
    undisturbed.step(std::array{1.0});
    CHECK_THROWS_AS(adam.step(std::array{1.0, 2.0}), dpr::InvalidArgument);
    CHECK_THROWS_WITH_AS(step_of(adam, std::nan("")),
                         "gradient (optimizer): got nan, expected finite numbers", dpr::InvalidArgument);
    CHECK(step_of(adam, 0.5) == step_of(undisturbed, 0.5));
  }
}

}  // namespace optimizer_test
