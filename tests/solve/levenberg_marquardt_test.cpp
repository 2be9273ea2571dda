// Steps and covariances of the normal equations.
#include "solve/levenberg_marquardt.hpp"

#include <doctest/doctest.h>

namespace levenberg_marquardt_test {

namespace {

/// H = ((4, 1), (1, 3)), g = (1, 2), S = ((2, 1), (1, 5)).
dpr::NormalEquations equations() {
  dpr::NormalEquations e;
  e.hessian = {4, 1, 1, 3};
  e.gradient = {1, 2};
  e.scatter = {2, 1, 1, 5};
  return e;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("without damping a step is Newton's, with much of it a short one downhill") {
    dpr::PoseSpace::Step step{};
    REQUIRE(dpr::damped_step(equations(), 2, 0, step));
    CHECK(step[0] == doctest::Approx(-1.0 / 11));
    CHECK(step[1] == doctest::Approx(-7.0 / 11));
    REQUIRE(dpr::damped_step(equations(), 2, 1e6, step));
    CHECK(step[0] == doctest::Approx(-1 / 4e6).epsilon(1e-4));
    CHECK(step[1] == doctest::Approx(-2 / 3e6).epsilon(1e-4));
  }

  TEST_CASE("the covariance is the scatter between two inverse Hessians") {
    const std::vector<double> c = dpr::covariance(equations(), 2);
    // H^-1 = ((3, -1), (-1, 4)) / 11.
    REQUIRE(c.size() == 4);
    CHECK(c[0] == doctest::Approx(17.0 / 121));
    CHECK(c[1] == doctest::Approx(-13.0 / 121));
    CHECK(c[2] == doctest::Approx(-13.0 / 121));
    CHECK(c[3] == doctest::Approx(74.0 / 121));
  }

  TEST_CASE("what the image leaves open has neither step nor covariance") {
    dpr::NormalEquations singular = equations();
    singular.hessian = {4, 2, 2, 1};
    dpr::PoseSpace::Step step{};
    CHECK_FALSE(dpr::damped_step(singular, 2, 0, step));
    CHECK(step[0] == 0);
    CHECK(dpr::damped_step(singular, 2, 0.1, step));
    CHECK(dpr::covariance(singular, 2).empty());
    singular.hessian = {};
    CHECK_FALSE(dpr::damped_step(singular, 2, 0.1, step));
  }
}

}  // namespace levenberg_marquardt_test
