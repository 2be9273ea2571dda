// Vertex clustering: fewer triangles, the same shape to a cell, colours and winding kept.
#include "mesh/cluster_vertices.hpp"

#include <doctest/doctest.h>

#include <cmath>

namespace cluster_vertices_test {

namespace {

using dpr::Mesh;

double enclosed_volume(const Mesh& mesh) {
  double volume = 0;
  for (const glm::uvec3& f : mesh.faces) {
    const glm::dvec3 a(mesh.positions[f.x]), b(mesh.positions[f.y]), c(mesh.positions[f.z]);
    volume += glm::dot(a, glm::cross(b, c)) / 6;
  }
  return volume;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("clustering: a fine sphere stays a closed, outward, coloured sphere with far fewer triangles") {
    const Mesh fine = dpr::make_icosphere(4);
    constexpr float k_cell = 0.25F;
    const Mesh coarse = dpr::cluster_vertices(fine, k_cell);
    CHECK(coarse.faces.size() < fine.faces.size() / 5);
    CHECK(coarse.faces.size() > 100);
    CHECK(enclosed_volume(coarse) == doctest::Approx(enclosed_volume(fine)).epsilon(0.1));
    REQUIRE(coarse.vertex_colors.size() == coarse.positions.size());
    for (std::size_t i = 0; i < coarse.positions.size(); ++i) {
      const glm::vec3& p = coarse.positions[i];
      CHECK(std::abs(glm::length(p) - 1) < k_cell / 4);
      CHECK(glm::length(coarse.vertex_colors[i] - (0.5F + 0.5F * p)) < 1e-5F);  // means of both
    }
    dpr::validate(coarse);
  }

  TEST_CASE("clustering: faces keep their colours, and equal ones become one") {
    Mesh mesh;
    mesh.positions = {{0.1F, 0.1F, 0}, {1.1F, 0.1F, 0}, {0.1F, 1.1F, 0}, {0.2F, 0.2F, 0}, {5, 5, 5}};
    mesh.faces = {{0, 1, 2}, {0, 3, 1}, {1, 2, 3}, {2, 1, 0}, {0, 1, 4}};
    mesh.face_colors = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}, {0, 1, 1}};
    const Mesh clustered = dpr::cluster_vertices(mesh, 1);
    // The second collapses, the third is the first again, the fourth looks the other way.
    REQUIRE(clustered.faces.size() == 3);
    CHECK(clustered.face_colors[0] == glm::vec3(1, 0, 0));
    CHECK(clustered.face_colors[1] == glm::vec3(1, 1, 0));
    CHECK(clustered.face_colors[2] == glm::vec3(0, 1, 1));
    CHECK(clustered.positions.size() == 4);
    CHECK(glm::length(clustered.positions[0] - glm::vec3(0.15F, 0.15F, 0)) < 1e-6F);
  }

  TEST_CASE("clustering: a mesh that would vanish stays as it is") {
    const Mesh cube = dpr::make_cube();
    const Mesh same = dpr::cluster_vertices(cube, 10);
    // Cells are counted from the origin, in the middle of the cube: eight are met, its corners'.
    CHECK(same.positions.size() == 8);
    Mesh aside = cube;
    for (glm::vec3& p : aside.positions) p += 2.0F;
    const Mesh kept = dpr::cluster_vertices(aside, 10);
    CHECK(kept.positions == aside.positions);
    CHECK(kept.faces == aside.faces);
  }
}

}  // namespace cluster_vertices_test
