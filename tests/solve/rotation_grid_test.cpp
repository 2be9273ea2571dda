// The grid of rotations: rotations all, and none far from one of them.
#include "solve/rotation_grid.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <random>

#include "dpr/pose.hpp"

namespace rotation_grid_test {

TEST_SUITE("unit") {
  TEST_CASE("every element is a rotation, and they are as many as asked for") {
    for (const std::size_t count : {0, 1, 2, 100}) {
      const std::vector<glm::dmat3> grid = dpr::rotation_grid(count);
      CHECK(grid.size() == count);
      for (const glm::dmat3& rotation : grid) {
        CHECK(glm::determinant(rotation) == doctest::Approx(1));
        for (int i = 0; i < 3; ++i) CHECK(glm::length(rotation[i]) == doctest::Approx(1));
      }
    }
  }

  TEST_CASE("no rotation is far from the grid, and a denser grid is nearer") {
    std::mt19937 generator(1);
    std::normal_distribution<double> normal;
    const auto furthest = [&](std::size_t count) {
      const std::vector<glm::dmat3> grid = dpr::rotation_grid(count);
      double worst = 0;
      for (int i = 0; i < 300; ++i) {
        const glm::dmat3 rotation = dpr::rotation_from_vector(
            2.0 * glm::dvec3(normal(generator), normal(generator), normal(generator)));
        double nearest = 180;
        for (const glm::dmat3& other : grid) nearest = std::min(nearest, dpr::angle_degrees(rotation, other));
        worst = std::max(worst, nearest);
      }
      return worst;
    };
    const double coarse = furthest(128), fine = furthest(1024);
    CHECK(coarse < 55);
    CHECK(fine < 28);
    CHECK(fine < 0.7 * coarse);  // eight times as many are twice as dense
  }
}

}  // namespace rotation_grid_test
