// Which meshes bound a solid, and which way their faces wind.
#include <doctest/doctest.h>

#include <limits>

#include "dpr/mesh.hpp"
#include "mesh/solid.hpp"

namespace solid_test {

using namespace dpr;

namespace {

Solid solid_of(const Mesh& mesh) {
  return {make_edges(mesh.faces, mesh.positions.size()), mesh.faces.size()};
}

int winding_of(const Mesh& mesh) { return solid_of(mesh).winding(mesh.positions, mesh.faces); }

Mesh inside_out(Mesh mesh) {
  for (glm::uvec3& face : mesh.faces) std::swap(face.y, face.z);
  return mesh;
}

Mesh joined(Mesh mesh, const Mesh& other, const glm::vec3& shift) {
  const auto first = static_cast<unsigned>(mesh.positions.size());
  for (const glm::vec3& p : other.positions) mesh.positions.push_back(p + shift);
  for (const glm::uvec3& face : other.faces) mesh.faces.push_back(face + first);
  return mesh;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("solid: closed meshes wind counter-clockwise, and clockwise inside out, wherever they lie") {
    for (const Mesh& mesh : {make_icosphere(2), make_torus(0.8F, 0.3F, 12, 7), make_cube()}) {
      CHECK(winding_of(mesh) == 1);
      CHECK(winding_of(inside_out(mesh)) == -1);
      Mesh far = mesh;
      for (glm::vec3& p : far.positions) p += glm::vec3(30, -20, 10);
      CHECK(winding_of(far) == 1);
    }
  }

  TEST_CASE("solid: a cube on vertices of its sides' own is closed as long as they coincide") {
    for (const Mesh& mesh : {make_icosphere(1), make_cube()}) {
      const Solid solid = solid_of(mesh);
      std::vector<glm::vec3> moved = mesh.positions;
      for (glm::vec3& p : moved) p = 2.0F * p + glm::vec3(0, 3, 0);
      CHECK(solid.winding(moved, mesh.faces) == 1);
      const glm::vec3 corner = moved[0];
      moved[0].x += 0.01F;
      CHECK(solid.winding(moved, mesh.faces) == (mesh.positions.size() != 24 ? 1 : 0));
      moved[0] = corner;
      CHECK(solid.winding(moved, mesh.faces) == 1);
    }
  }

  TEST_CASE("solid: a hole, a face turned round, or none at all") {
    Mesh open = make_icosphere(1), turned = open;
    open.faces.pop_back();
    std::swap(turned.faces[3].x, turned.faces[3].y);
    for (const Mesh& mesh : {open, turned, Mesh{}}) {
      CHECK(winding_of(mesh) == 0);
    }
  }

  TEST_CASE("solid: parts that wind differently have no winding together") {
    const Mesh ball = make_icosphere(1);
    CHECK(winding_of(joined(ball, ball, {3, 0, 0})) == 1);
    CHECK(winding_of(joined(ball, inside_out(ball), {3, 0, 0})) == 0);
    CHECK(winding_of(joined(inside_out(ball), inside_out(ball), {3, 0, 0})) == -1);
    for (const Mesh& other : {ball, inside_out(ball)}) {
      Mesh both = joined(ball, other, {3, 0, 0}), mixed = both;
      const std::size_t half = both.faces.size() / 2;  // faces of the parts by turns
      for (std::size_t i = 0; i < both.faces.size(); ++i) mixed.faces[i] = both.faces[i % 2 * half + i / 2];
      CHECK(winding_of(mixed) == winding_of(both));
    }
  }

  TEST_CASE("solid: positions that are not finite have none") {
    Mesh ball = make_icosphere(1);
    ball.positions[5].y = std::numeric_limits<float>::quiet_NaN();
    CHECK(winding_of(ball) == 0);
  }
}

}  // namespace solid_test
