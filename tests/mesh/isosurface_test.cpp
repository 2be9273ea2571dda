// Surfaces of fields on grids.
#include "mesh/isosurface.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <random>

#include "mesh/remesh.hpp"
#include "mesh/solid.hpp"
#include "support/reduced.hpp"

namespace isosurface_test {

namespace {

using dpr::Mesh;
using dpr::ScalarGrid;

/// Of `count` cells a side about the origin.
ScalarGrid sampled(int count, double half_side, const std::function<double(const glm::dvec3&)>& field) {
  ScalarGrid grid{glm::ivec3(count + 1), glm::dvec3(-half_side), 2 * half_side / count, {}};
  for (int z = 0; z <= count; ++z) {
    for (int y = 0; y <= count; ++y) {
      for (int x = 0; x <= count; ++x)
        grid.values.push_back(static_cast<float>(field(grid.position({x, y, z}))));
    }
  }
  return grid;
}

int winding(const Mesh& mesh) {
  return dpr::Solid(dpr::make_edges(mesh.faces, mesh.positions.size()), mesh.faces.size())
      .winding(mesh.positions, mesh.faces);
}

/// Of a closed triangle mesh: two a part, less two a handle.
long euler_characteristic(const Mesh& mesh) {
  return static_cast<long>(mesh.positions.size()) - static_cast<long>(mesh.faces.size()) / 2;
}

double torus(const glm::dvec3& p) {
  return 0.3 - glm::length(glm::dvec2(glm::length(glm::dvec2(p)) - 0.7, p.z));
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("a ball's surface is closed, wound outwards, and within a fifth of a cell of the ball") {
    const ScalarGrid grid = sampled(20, 1.2, [](const glm::dvec3& p) { return 1 - glm::length(p); });
    const Mesh mesh = dpr::isosurface(grid);
    CHECK(winding(mesh) == 1);
    CHECK(euler_characteristic(mesh) == 2);
    float worst = 0;
    for (const glm::vec3& p : mesh.positions) worst = std::max(worst, std::abs(glm::length(p) - 1));
    CHECK(worst < 0.2F * static_cast<float>(grid.cell));  // 0.13
  }

  TEST_CASE("a torus has one hole") {
    const Mesh mesh = dpr::isosurface(sampled(24, 1.2, torus));
    CHECK(winding(mesh) == 1);
    CHECK(euler_characteristic(mesh) == 0);
  }

  TEST_CASE("any signs of a cell's corners give a closed manifold that can be remeshed") {
    std::mt19937 generator(7);
    std::uniform_real_distribution<double> noise(-1, 1);
    const int cells = dpr::test::reduced(12, 5);
    const ScalarGrid grid = sampled(cells, 1, [&](const glm::dvec3& p) {
      const bool is_border = std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) > 0.999;
      return is_border ? -1 : noise(generator);
    });
    const Mesh mesh = dpr::isosurface(grid);
    REQUIRE(mesh.faces.size() > 100);
    CHECK(winding(mesh) == 1);
    CHECK(dpr::remesh(mesh, static_cast<float>(grid.cell)).has_value());
  }

  TEST_CASE("without a positive value there is nothing") {
    const Mesh mesh = dpr::isosurface(sampled(4, 1, [](const glm::dvec3&) { return 0; }));
    CHECK(mesh.faces.empty());
    CHECK(mesh.positions.empty());
  }
}

}  // namespace isosurface_test
