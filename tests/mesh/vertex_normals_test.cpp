// Normals of vertices, and their gradients.
#include "dpr/vertex_normals.hpp"

#include <doctest/doctest.h>

#include <limits>
#include <random>
#include <vector>

#include "dpr/error.hpp"
#include "dpr/mesh.hpp"

namespace vertex_normals_test {
namespace {

using dpr::vec3;

/// A sphere with bumps, and a vertex without faces.
dpr::Mesh make_bumpy_sphere() {
  dpr::Mesh mesh = dpr::make_icosphere(2);
  std::mt19937 random(7);
  for (vec3& p : mesh.positions) p *= std::uniform_real_distribution<float>(0.8F, 1.2F)(random);
  mesh.positions.emplace_back(3, 0, 0);
  return mesh;
}

std::vector<vec3> random_vectors(std::size_t count) {
  std::mt19937 random(8);
  std::uniform_real_distribution<float> number(-1, 1);
  std::vector<vec3> vectors(count);
  for (vec3& v : vectors) v = {number(random), number(random), number(random)};
  return vectors;
}

double dot(const std::vector<vec3>& a, const std::vector<vec3>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += double{glm::dot(a[i], b[i])};
  return sum;
}

TEST_CASE("normals of a sphere's vertices point away from its centre, those without faces are 0") {
  dpr::Mesh mesh = dpr::make_icosphere(3);
  mesh.positions.emplace_back(3, 0, 0);
  const std::vector<vec3> normals = dpr::vertex_normals(mesh.positions, mesh.faces);
  REQUIRE(normals.size() == mesh.positions.size());
  CHECK(normals.back() == vec3(0));
  for (std::size_t i = 0; i + 1 < normals.size(); ++i) {
    CHECK(glm::length(normals[i]) == doctest::Approx(1));
    CHECK(glm::dot(normals[i], glm::normalize(mesh.positions[i])) > 0.999F);
  }
}

TEST_CASE("gradients of vertex normals are those of finite differences") {
  const dpr::Mesh mesh = make_bumpy_sphere();
  const std::vector<vec3> grad = random_vectors(mesh.positions.size());
  const std::vector<vec3> found = dpr::vertex_normals_backward(mesh.positions, mesh.faces, grad);
  for (std::size_t i = 0; i < mesh.positions.size(); i += 9) {
    for (int axis = 0; axis < 3; ++axis) {
      constexpr float k_step = 1e-3F;
      std::vector<vec3> before = mesh.positions, behind = before;
      before[i][axis] -= k_step, behind[i][axis] += k_step;
      const double difference = (dot(dpr::vertex_normals(behind, mesh.faces), grad) -
                                 dot(dpr::vertex_normals(before, mesh.faces), grad)) /
                                double{behind[i][axis] - before[i][axis]};
      CHECK(found[i][axis] == doctest::Approx(difference).epsilon(0.002).scale(1));
    }
  }
  CHECK(found.back() == vec3(0));
}

TEST_CASE("normals of wrong meshes are refused") {
  const dpr::Mesh mesh = make_bumpy_sphere();
  std::vector<vec3> positions = mesh.positions;
  CHECK_THROWS_AS(dpr::vertex_normals({positions.data(), 3}, mesh.faces), dpr::InvalidArgument);
  CHECK_THROWS_AS(dpr::vertex_normals_backward(positions, mesh.faces, {positions.data(), 3}),
                  dpr::InvalidArgument);
  positions[4].y = std::numeric_limits<float>::quiet_NaN();
  CHECK_THROWS_AS(dpr::vertex_normals(positions, mesh.faces), dpr::InvalidArgument);
}

}  // namespace
}  // namespace vertex_normals_test
