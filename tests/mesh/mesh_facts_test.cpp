// Kinds of surfaces: closed, open, torn, turned inside out in parts.
#include "mesh/mesh_facts.hpp"

#include <doctest/doctest.h>

#include <initializer_list>

namespace mesh_facts_test {

namespace {

using dpr::Mesh;
using dpr::mesh_facts;
using dpr::MeshFacts;

/// Triangles of the corners of a square, of its middle, and of points above and below that.
MeshFacts facts_of(std::initializer_list<glm::uvec3> faces) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0},       {1, 0, 0},       {1, 1, 0},       {0, 1, 0},
                    {0.5F, 0.5F, 0}, {0.5F, 0.5F, 1}, {0.5F, 0.5F, -1}};
  mesh.faces = faces;
  return mesh_facts(mesh);
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("mesh facts: seams do not open a cube, and its sides are one part") {
    const MeshFacts facts = mesh_facts(dpr::make_cube());
    CHECK(facts.distinct_positions == 8);
    CHECK(facts.components == 1);
    CHECK(facts.edges == 18);
    CHECK(facts.is_closed());
    CHECK(facts.is_manifold());
    CHECK(facts.is_oriented());
    CHECK(facts.faces_without_area == 0);
    CHECK(facts.unused_vertices == 0);
  }

  TEST_CASE("mesh facts: Euler's formula on a sphere and a torus") {
    const auto euler = [](const Mesh& mesh) {
      const MeshFacts facts = mesh_facts(mesh);
      CHECK(facts.is_closed());
      CHECK(facts.is_manifold());
      CHECK(facts.components == 1);
      return static_cast<int>(facts.distinct_positions + mesh.faces.size()) - static_cast<int>(facts.edges);
    };
    CHECK(euler(dpr::make_icosphere(2)) == 2);
    CHECK(euler(dpr::make_torus(1, 0.4F, 8, 6)) == 0);
  }

  TEST_CASE("mesh facts: a square is open; two parts that touch nowhere are two") {
    const MeshFacts square = facts_of({{0, 1, 2}, {0, 2, 3}});
    CHECK(square.edges == 5);
    CHECK(square.boundary_edges == 4);
    CHECK_FALSE(square.is_closed());
    CHECK(square.is_manifold());
    CHECK(square.is_oriented());
    CHECK(square.unused_vertices == 3);
    CHECK(facts_of({{0, 1, 2}, {3, 4, 5}}).components == 2);
  }

  TEST_CASE("mesh facts: a triangle turned over") {
    const MeshFacts facts = facts_of({{0, 1, 2}, {0, 3, 2}});
    CHECK(facts.reversed_edges == 1);
    CHECK_FALSE(facts.is_oriented());
    CHECK(facts.is_manifold());
  }

  TEST_CASE("mesh facts: three triangles at an edge, and two at a vertex alone, are not manifold") {
    const MeshFacts edge = facts_of({{0, 2, 1}, {0, 2, 3}, {0, 2, 5}});
    CHECK(edge.non_manifold_edges == 1);
    CHECK_FALSE(edge.is_manifold());
    const MeshFacts vertex = facts_of({{4, 0, 1}, {4, 2, 3}});
    CHECK(vertex.non_manifold_edges == 0);
    CHECK(vertex.non_manifold_vertices == 1);
    CHECK(vertex.components == 1);
    CHECK_FALSE(vertex.is_manifold());
  }

  TEST_CASE("mesh facts: triangles without area, and nothing else") {
    const MeshFacts facts = facts_of({{0, 0, 1}, {5, 4, 6}});
    CHECK(facts.faces_without_area == 2);
    CHECK(facts.components == 0);
    CHECK(facts.edges == 3);  // of the second, whose corners differ
    CHECK(facts_of({{0, 0, 0}}).components == 0);
    CHECK_FALSE(facts_of({{0, 0, 0}}).is_closed());
    CHECK(facts_of({{0, 1, 2}, {5, 4, 6}}).components == 1);             // a part of no area is not seen
    CHECK(facts_of({{0, 1, 3}, {5, 4, 6}, {2, 4, 3}}).components == 1);  // joined at 3 and 4
  }
}

}  // namespace mesh_facts_test
