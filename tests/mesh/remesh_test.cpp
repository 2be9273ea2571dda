// Remeshing: edges of the length asked for, the surface where it was, and what cannot be remeshed.
#include "mesh/remesh.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>
#include <map>
#include <utility>
#include <vector>

#include "dpr/error.hpp"
#include "dpr/voxels.hpp"
#include "mesh/adjacency.hpp"

namespace remesh_test {

namespace {

using dpr::Mesh;

/// Parts of the edges shorter than 3/5 and longer than 5/3 of the length.
double odd_edges(const Mesh& mesh, float length) {
  const dpr::Adjacency adjacency = dpr::make_adjacency(mesh);
  std::size_t odd = 0;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    for (std::uint32_t k = adjacency.ring_starts[v]; k < adjacency.ring_starts[v + 1]; ++k) {
      const float edge = glm::distance(mesh.positions[v], mesh.positions[adjacency.ring[k]]);
      if (edge < 0.6F * length || edge > length / 0.6F) ++odd;
    }
  }
  return static_cast<double>(odd) / static_cast<double>(adjacency.ring.size());
}

bool is_closed(const Mesh& mesh) {
  const dpr::Adjacency adjacency = dpr::make_adjacency(mesh);
  return adjacency.hinges.size() == adjacency.edges() && 2 * adjacency.edges() == 3 * mesh.faces.size();
}

/// The ends of edges that one face has.
std::vector<glm::vec3> border_of(const Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> faces;
  for (const glm::uvec3& f : mesh.faces) {
    for (int i = 0; i < 3; ++i) ++faces[std::minmax(f[i], f[(i + 1) % 3])];
  }
  std::vector<glm::vec3> ends;
  for (const auto& [edge, count] : faces) {
    if (count == 1) ends.insert(ends.end(), {mesh.positions[edge.first], mesh.positions[edge.second]});
  }
  return ends;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("remesh: finer and coarser, edges have the length, the sphere stays a closed sphere") {
    const Mesh sphere = dpr::make_icosphere(3);
    for (const float length : {0.08F, 0.3F}) {
      const auto result = dpr::remesh(sphere, length, 5);
      REQUIRE(result);
      CHECK(odd_edges(*result, length) < 0.02);
      CHECK(is_closed(*result));
      for (const glm::vec3& p : result->positions) CHECK(glm::length(p) == doctest::Approx(1).epsilon(0.04));
      const dpr::Bounds box{glm::vec3(-1.1F), glm::vec3(1.1F)};
      CHECK(dpr::iou(dpr::voxelize(sphere, 32, box), dpr::voxelize(*result, 32, box)) > 0.93);
      CHECK(result->vertex_colors.size() == result->positions.size());
    }
  }

  TEST_CASE("remesh: stretched triangles become even ones; colours stay with the places") {
    Mesh mesh = dpr::make_torus(1, 0.3F, 60, 6);
    for (std::size_t i = 0; i < mesh.positions.size(); ++i)
      mesh.vertex_colors[i] = 0.5F + 0.3F * mesh.positions[i];
    const auto result = dpr::remesh(mesh, 0.15F, 5);
    REQUIRE(result);
    CHECK(odd_edges(mesh, 0.15F) > 0.2);
    CHECK(odd_edges(*result, 0.15F) < 0.03);
    double worst = 0;
    for (std::size_t i = 0; i < result->positions.size(); ++i) {
      const glm::vec3 error = result->vertex_colors[i] - (0.5F + 0.3F * result->positions[i]);
      worst = std::max(worst, static_cast<double>(glm::length(error)));
    }
    CHECK(worst < 0.05);
  }

  TEST_CASE("remesh: a border stays, and the same mesh comes out every time") {
    Mesh open = dpr::make_icosphere(2);
    open.faces.resize(open.faces.size() / 2);
    const auto first = dpr::remesh(open, 0.15F), second = dpr::remesh(open, 0.15F);
    REQUIRE(first);
    CHECK(first->positions == second->positions);
    CHECK(first->faces == second->faces);
    CHECK_FALSE(is_closed(*first));
    for (const glm::vec3& p : border_of(open))
      CHECK(std::ranges::find(first->positions, p) != first->positions.end());
  }

  TEST_CASE("remesh: what is not manifold is left alone") {
    Mesh fan;
    fan.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}};
    fan.faces = {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}};
    CHECK_FALSE(dpr::remesh(fan, 0.2F));
    Mesh repeated;
    repeated.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    repeated.faces = {{0, 0, 1}, {0, 1, 2}};  // a corner twice
    CHECK_FALSE(dpr::remesh(repeated, 0.2F));
  }

  TEST_CASE("remesh: a length that would take all memory is refused") {
    CHECK_THROWS_AS(dpr::remesh(dpr::make_icosphere(1), 1e-4F), dpr::InvalidArgument);
  }
}

}  // namespace remesh_test
