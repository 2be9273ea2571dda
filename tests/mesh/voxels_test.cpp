// The voxeliser on shapes whose volume is known, with rays through edges and vertices, and on what is no
// clean surface.
#include "dpr/voxels.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "dpr/error.hpp"

namespace voxels_test {

using dpr::Bounds;
using dpr::FillRule;
using dpr::Mesh;
using dpr::VoxelGrid;
using dpr::voxelize;

namespace {

constexpr double k_pi = 3.14159265358979323846;

double volume(const VoxelGrid& grid) {
  const glm::dvec3 size = glm::dvec3(grid.bounds.high) - glm::dvec3(grid.bounds.low);
  return size.x * size.y * size.z * static_cast<double>(grid.count()) / std::pow(grid.resolution, 3);
}

Mesh moved(Mesh mesh, glm::vec3 by) {
  for (glm::vec3& p : mesh.positions) p += by;
  return mesh;
}

Mesh joined(Mesh a, const Mesh& b) {
  const auto first = static_cast<unsigned>(a.positions.size());
  a.positions.insert(a.positions.end(), b.positions.begin(), b.positions.end());
  for (const glm::uvec3& face : b.faces) a.faces.push_back(face + first);
  a.face_colors.clear();
  a.vertex_colors.clear();
  return a;
}

Mesh inverted(Mesh mesh) {
  for (glm::uvec3& face : mesh.faces) std::swap(face.x, face.y);
  return mesh;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("voxelize: a cube on cell borders is exact, though rays hit diagonals and corners") {
    // Centres at odd multiples of 1/2: columns run along the diagonals of the cube's sides.
    const VoxelGrid grid = voxelize(dpr::make_cube(), 6, {glm::vec3(-3), glm::vec3(3)});
    CHECK(grid.count() == 8);
    CHECK(grid.occupied(2, 3, 2));
    CHECK_FALSE(grid.occupied(1, 3, 2));
    CHECK(voxelize(dpr::make_cube(), 12, {glm::vec3(-3), glm::vec3(3)}).count() == 64);
  }

  TEST_CASE("voxelize: centres on the surface itself belong to its lower sides") {
    // Centres at -2, ..., 2: of each axis' -1, 0 and 1 the half-open cube holds -1 and 0.
    const VoxelGrid grid = voxelize(dpr::make_cube(), 5, {glm::vec3(-2.5F), glm::vec3(2.5F)});
    CHECK(grid.count() == 8);
    CHECK(grid.occupied(1, 1, 1));
    CHECK_FALSE(grid.occupied(3, 2, 2));
  }

  TEST_CASE("voxelize: the octahedron, whose rays at the centre go through vertices and along edges") {
    Mesh octahedron;
    octahedron.positions = {{2, 0, 0}, {-2, 0, 0}, {0, 2, 0}, {0, -2, 0}, {0, 0, 2}, {0, 0, -2}};
    octahedron.faces = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                        {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
    const VoxelGrid grid = voxelize(octahedron, 7, {glm::vec3(-3.5F), glm::vec3(3.5F)});
    for (unsigned z = 0; z < 7; ++z) {
      for (unsigned y = 0; y < 7; ++y) {
        for (unsigned x = 0; x < 7; ++x) {
          const int distance = std::abs(static_cast<int>(x) - 3) + std::abs(static_cast<int>(y) - 3) +
                               std::abs(static_cast<int>(z) - 3);
          if (distance == 2) continue;  // on the surface
          CHECK(grid.occupied(x, y, z) == (distance < 2));
        }
      }
    }
  }

  TEST_CASE("voxelize: volumes of a sphere and of a torus, also in a box that is no cube") {
    const double sphere = 4.0 / 3.0 * k_pi;
    CHECK(volume(voxelize(dpr::make_icosphere(5), 64, {glm::vec3(-1.1F), glm::vec3(1.1F)})) ==
          doctest::Approx(sphere).epsilon(0.01));
    const VoxelGrid flat =
        voxelize(dpr::make_torus(1.0F, 0.3F, 96, 48), 64, {{-1.5F, -0.4F, -1.4F}, {1.4F, 0.5F, 1.6F}});
    CHECK(volume(flat) == doctest::Approx(2 * k_pi * k_pi * 0.09).epsilon(0.01));
  }

  TEST_CASE("voxelize: every centre of random tetrahedra against their planes") {
    std::mt19937 generator(3);
    const auto uniform = [&] { return std::ldexp(static_cast<float>(generator() >> 8), -23) - 1; };
    for (int trial = 0; trial < 20; ++trial) {
      Mesh mesh;
      mesh.faces = {{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}};
      for (int i = 0; i < 4; ++i) mesh.positions.emplace_back(uniform(), uniform(), uniform());
      const VoxelGrid grid = voxelize(mesh, 9, {glm::vec3(-1), glm::vec3(1)});
      glm::dmat3 edges;
      for (int i = 0; i < 3; ++i)
        edges[i] = glm::dvec3(mesh.positions[static_cast<std::size_t>(i) + 1] - mesh.positions[0]);
      for (unsigned i = 0; i < 729; ++i) {
        const glm::dvec3 centre = (glm::dvec3(i % 9, i / 9 % 9, i / 81) + 0.5) / 4.5 - 1.0;
        const glm::dvec3 b = glm::inverse(edges) * (centre - glm::dvec3(mesh.positions[0]));
        const double inside = std::min({b.x, b.y, b.z, 1 - b.x - b.y - b.z});
        if (std::abs(inside) < 1e-6) continue;
        CHECK(grid.cells[i] == (inside > 0 ? 1 : 0));
      }
    }
  }

  TEST_CASE("voxelize: overlapping parts, inverted faces and mixed orientation, by either rule") {
    const Bounds box{glm::vec3(-3), glm::vec3(3)};
    const Mesh two = joined(dpr::make_cube(), moved(dpr::make_cube(), glm::vec3(1, 0, 0)));
    CHECK(voxelize(two, 6, box).count() == 12);
    CHECK(voxelize(two, 6, box, FillRule::even_odd).count() == 8);
    CHECK(voxelize(inverted(dpr::make_cube()), 6, box).count() == 8);
    Mesh mixed = dpr::make_cube();
    for (std::size_t i = 0; i < mixed.faces.size(); i += 3) std::swap(mixed.faces[i].x, mixed.faces[i].y);
    CHECK(voxelize(mixed, 6, box, FillRule::even_odd).count() == 8);
  }

  TEST_CASE("voxelize: one hole is outvoted by the other axes; parts outside the box count") {
    Mesh open = dpr::make_cube();
    open.faces.erase(open.faces.begin(), open.faces.begin() + 2);
    open.face_colors.clear();
    CHECK(voxelize(open, 6, {glm::vec3(-3), glm::vec3(3)}).count() == 8);
    CHECK(voxelize(dpr::make_cube(), 4, {glm::vec3(-0.5F), glm::vec3(0.5F)}).count() == 64);
    CHECK(voxelize(dpr::make_cube(), 4, {glm::vec3(2), glm::vec3(3)}).count() == 0);
  }

  TEST_CASE("iou: of shifted cubes, of equals, of nothing") {
    const Bounds box{glm::vec3(-4), glm::vec3(4)};
    const VoxelGrid a = voxelize(dpr::make_cube(), 16, box);
    const VoxelGrid b = voxelize(moved(dpr::make_cube(), glm::vec3(1, 0, 0)), 16, box);
    CHECK(dpr::iou(a, b) == doctest::Approx(1.0 / 3.0));
    CHECK(dpr::iou(a, a) == 1.0);
    const VoxelGrid none = voxelize(moved(dpr::make_cube(), glm::vec3(9)), 16, box);
    CHECK(dpr::iou(a, none) == 0.0);
    CHECK(dpr::iou(none, none) == 1.0);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("voxelize and iou refuse what they cannot compare") {
    const Mesh cube = dpr::make_cube();
    const Bounds box;
    CHECK_THROWS_AS(voxelize(cube, 0, box), dpr::InvalidArgument);
    CHECK_THROWS_AS(voxelize(cube, 513, box), dpr::InvalidArgument);
    CHECK_THROWS_AS(voxelize(cube, 4, {glm::vec3(1), glm::vec3(1)}), dpr::InvalidArgument);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    CHECK_THROWS_AS(voxelize(cube, 4, {glm::vec3(nan), glm::vec3(1)}), dpr::InvalidArgument);
    CHECK_THROWS_AS(voxelize(Mesh{}, 4, box), dpr::InvalidArgument);
    CHECK_THROWS_AS(dpr::iou(voxelize(cube, 4, box), voxelize(cube, 5, box)), dpr::InvalidArgument);
    CHECK_THROWS_AS(dpr::iou(voxelize(cube, 4, box), voxelize(cube, 4, {glm::vec3(-2), glm::vec3(1)})),
                    dpr::InvalidArgument);
  }
}

}  // namespace voxels_test
