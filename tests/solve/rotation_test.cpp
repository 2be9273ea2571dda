// Rotations: the exponential map and its inverse near 0 and pi, and the polar decomposition.
#include <doctest/doctest.h>

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <random>

#include "dpr/pose.hpp"
#include "solve/polar.hpp"

namespace rotation_test {

namespace {

constexpr double k_pi = 3.14159265358979323846;

double distance(const glm::dmat3& a, const glm::dmat3& b) {
  const glm::dmat3 d = a - b;
  return std::sqrt(glm::dot(d[0], d[0]) + glm::dot(d[1], d[1]) + glm::dot(d[2], d[2]));
}

glm::dvec3 random_axis(std::mt19937& generator) {
  std::normal_distribution<double> normal;
  return glm::normalize(glm::dvec3(normal(generator), normal(generator), normal(generator)));
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("a quarter turn about z takes x to y") {
    const glm::dvec3 turned = dpr::rotation_from_vector({0, 0, k_pi / 2}) * glm::dvec3(1, 0, 0);
    CHECK(glm::length(turned - glm::dvec3(0, 1, 0)) < 1e-15);
  }

  TEST_CASE("the same as glm's rotation") {
    std::mt19937 generator(1);
    for (double angle : {1e-12, 1e-3, 0.5, 2.0, 3.1, 4.0, 7.0}) {
      const glm::dvec3 axis = random_axis(generator);
      const glm::dmat3 expected(glm::rotate(glm::dmat4(1.0), angle, axis));
      CHECK(distance(dpr::rotation_from_vector(angle * axis), expected) < 1e-14);
    }
  }

  TEST_CASE("the logarithm undoes the exponential to the last digits, near 0 and pi too") {
    std::mt19937 generator(2);
    for (double angle : {0.0, 1e-200, 1e-12, 1e-7, 1e-3, 1.0, 2.5, k_pi - 1e-3, k_pi - 1e-7, k_pi - 1e-12}) {
      for (int i = 0; i < 20; ++i) {
        const glm::dvec3 r = angle * random_axis(generator);
        const glm::dvec3 back = dpr::vector_from_rotation(dpr::rotation_from_vector(r));
        CHECK(glm::length(back - r) <= 1e-15 + 1e-14 * angle);
      }
    }
  }

  TEST_CASE("at pi either sign of the axis is the same rotation") {
    for (const glm::dvec3 axis : {glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0, 0, 1),
                                  glm::normalize(glm::dvec3(1, -2, 3))}) {
      const glm::dvec3 r = dpr::vector_from_rotation(dpr::rotation_from_vector(k_pi * axis));
      CHECK(glm::length(r) == doctest::Approx(k_pi).epsilon(1e-14));
      CHECK(std::abs(glm::dot(r, axis)) == doctest::Approx(k_pi).epsilon(1e-14));
    }
  }

  TEST_CASE("angles past pi come back the short way") {
    const glm::dvec3 r = dpr::vector_from_rotation(dpr::rotation_from_vector({4, 0, 0}));
    CHECK(r.x == doctest::Approx(4 - 2 * k_pi));
  }

  TEST_CASE("the angle between two rotations") {
    const glm::dmat3 a = dpr::rotation_from_vector({0.3, -1.1, 0.7});
    for (double degrees : {0.0, 1e-9, 1e-3, 50.0, 179.999999, 180.0}) {
      const glm::dmat3 b = a * dpr::rotation_from_vector(glm::radians(degrees) * glm::dvec3(0, 1, 0));
      CHECK(dpr::angle_degrees(a, b) == doctest::Approx(degrees).epsilon(1e-10));
      CHECK(dpr::angle_degrees(b, a) == doctest::Approx(degrees).epsilon(1e-10));
      CHECK(dpr::angle_degrees(a, b) <= 180.0);
    }
  }

  TEST_CASE("the polar decomposition takes rotation and scale apart") {
    const glm::dmat3 rotation = dpr::rotation_from_vector({1, 2, -0.5});
    const glm::dmat3 axes = dpr::rotation_from_vector({0.2, 0.1, 0.9});
    for (const glm::dvec3 scale : {glm::dvec3(1), glm::dvec3(3), glm::dvec3(1e-6), glm::dvec3(1e5),
                                   glm::dvec3(1, 2, 5), glm::dvec3(1e-3, 1, 1e3)}) {
      const glm::dmat3 stretch = axes * glm::dmat3(glm::scale(glm::dmat4(1.0), scale)) * glm::transpose(axes);
      const dpr::Polar polar = dpr::polar_decomposition(rotation * stretch);
      CHECK(distance(polar.rotation, rotation) < 1e-9);
      CHECK(distance(polar.stretch, stretch) < 1e-9 * glm::length(scale));
    }
  }

  TEST_CASE("a mirror stays in the stretch") {
    const glm::dmat3 rotation = dpr::rotation_from_vector({0.4, 0, 0});
    const dpr::Polar polar = dpr::polar_decomposition(-2.0 * rotation);
    CHECK(glm::determinant(polar.rotation) == doctest::Approx(1));
    CHECK(distance(polar.rotation, rotation) < 1e-14);
    CHECK(distance(polar.stretch, glm::dmat3(-2.0)) < 1e-14);
  }
}

}  // namespace rotation_test
