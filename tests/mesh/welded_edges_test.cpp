// Edges by position: who shares one, with which vertices, in which direction.
#include "mesh/welded_edges.hpp"

#include <doctest/doctest.h>

#include <algorithm>

#include "dpr/mesh.hpp"

namespace welded_edges_test {

using dpr::Mesh;
using dpr::WeldedEdge;

namespace {

std::vector<WeldedEdge> edges_of(const Mesh& mesh) {
  std::vector<WeldedEdge> edges = dpr::make_edges(mesh.faces, mesh.positions.size());
  dpr::join_open(mesh.positions, mesh.faces, edges);
  return edges;
}

std::size_t count(const std::vector<WeldedEdge>& edges, bool (*matches)(const WeldedEdge&)) {
  return static_cast<std::size_t>(std::ranges::count_if(edges, matches));
}

bool is_alone(const WeldedEdge& e) { return !e.other; }
bool is_split(const WeldedEdge& e) { return e.other && !e.shares_vertices; }

/// Two triangles over the edge from (0, 0) to (1, 0).
Mesh two_triangles() {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, -1, 0}};
  mesh.faces = {{0, 1, 2}, {1, 0, 3}};
  return mesh;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("welded edges: a closed surface has each of its edges once") {
    const Mesh sphere = dpr::make_icosphere(2);
    const std::vector<WeldedEdge> edges = edges_of(sphere);
    CHECK(edges.size() == sphere.faces.size() * 3 / 2);
    for (const WeldedEdge& edge : edges) {
      REQUIRE(edge.other);
      CHECK(edge.shares_vertices);
      CHECK(!edge.same_direction);
      CHECK(*edge.other != edge.face);
    }
  }

  TEST_CASE("welded edges: the sides of a cube with vertices of their own belong together") {
    const std::vector<WeldedEdge> edges = edges_of(dpr::make_cube());
    CHECK(count(edges, is_alone) == 0);
    CHECK(count(edges, is_split) == 24);  // each of twelve edges on the vertices of both sides
    CHECK(edges.size() == 30);            // and six diagonals
  }

  TEST_CASE("welded edges: ends, direction and the other face") {
    Mesh mesh = two_triangles();
    std::vector<WeldedEdge> edges = edges_of(mesh);
    CHECK(edges.size() == 5);
    CHECK(count(edges, is_alone) == 4);
    const auto shared = [&] {
      return *std::ranges::find_if(edges, [](const WeldedEdge& e) { return e.other.has_value(); });
    };
    CHECK(shared().first == 0);
    CHECK(shared().second == 1);
    CHECK(shared().face == 0);
    CHECK(*shared().other == 1);
    CHECK(!shared().same_direction);
    std::swap(mesh.faces[1].x, mesh.faces[1].y);
    edges = edges_of(mesh);
    CHECK(shared().same_direction);
    mesh.positions.push_back(-mesh.positions[0]);  // -0 is 0
    mesh.faces[1].x = 4;
    edges = edges_of(mesh);
    CHECK(count(edges, is_split) == 2);
    CHECK(shared().same_direction);
  }

  TEST_CASE(
      "welded edges: where three faces meet each is alone; faces without area have none by their vertices") {
    Mesh mesh = two_triangles();
    mesh.positions.push_back({0, 0, 1});
    mesh.faces.push_back({0, 1, 4});
    CHECK(count(edges_of(mesh), is_alone) == 9);
    mesh.faces = {{0, 0, 1}, {2, 2, 2}};
    CHECK(edges_of(mesh).empty());
    CHECK(edges_of({}).empty());
  }
}

}  // namespace welded_edges_test
