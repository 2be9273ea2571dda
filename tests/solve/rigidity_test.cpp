// The energy that keeps a mesh as rigid as possible: its values where they are known, and its gradient.
#include "solve/rigidity.hpp"

#include <doctest/doctest.h>

#include <cmath>

#include "dpr/pose.hpp"

namespace rigidity_test {

namespace {

using dpr::Mesh;
using dpr::Rigidity;

constexpr double k_rigidity_weight = 3;

std::vector<double> flattened(const std::vector<glm::dvec3>& points) {
  std::vector<double> values;
  for (const glm::dvec3& p : points) values.insert(values.end(), {p.x, p.y, p.z});
  return values;
}

template <typename Motion>
std::vector<double> after_motion(const Mesh& mesh, const Motion& motion) {
  std::vector<glm::dvec3> points;
  for (const glm::vec3& p : mesh.positions) points.push_back(motion(glm::dvec3(p)));
  return flattened(points);
}

/// A bend, a twist and a dent.
glm::dvec3 bend_and_twist(const glm::dvec3& p) {
  return {p.x + 0.3 * p.y * p.y, p.y * std::cos(0.4 * p.z) - p.x * std::sin(0.4 * p.z),
          p.z + 0.2 * std::sin(3 * p.x)};
}

Mesh flat_square() {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("rigidity: rigid motions cost nothing, a stretch its square, a mirror image much") {
    const Mesh mesh = dpr::make_torus(1, 0.4F, 9, 6);
    const Rigidity rigidity(mesh, k_rigidity_weight);
    std::vector<double> gradient;
    const glm::dmat3 rotation = dpr::rotation_from_vector({0.5, -2, 1});
    const auto rigid =
        after_motion(mesh, [&](const glm::dvec3& p) { return rotation * p + glm::dvec3(3, -1, 2); });
    CHECK(rigidity.evaluate(rigid, gradient) < 1e-12);
    for (const double slope : gradient) CHECK(std::abs(slope) < 1e-9);
    const auto stretched = after_motion(mesh, [&](const glm::dvec3& p) { return rotation * (1.1 * p); });
    CHECK(rigidity.evaluate(stretched, gradient) == doctest::Approx(k_rigidity_weight * 0.01).epsilon(1e-9));
    const auto mirrored = after_motion(mesh, [](const glm::dvec3& p) { return glm::dvec3(-p.x, p.y, p.z); });
    CHECK(rigidity.evaluate(mirrored, gradient) > 1e-2);
  }

  TEST_CASE("rigidity: the gradient is that of finite differences, also where rings are flat") {
    constexpr double k_step = 1e-5;
    for (const Mesh& mesh : {dpr::make_torus(1, 0.4F, 7, 5), flat_square()}) {
      const Rigidity rigidity(mesh, k_rigidity_weight);
      std::vector<double> positions = after_motion(mesh, bend_and_twist), gradient, unused;
      rigidity.evaluate(positions, gradient);
      double norm = 0, error = 0;
      for (std::size_t i = 0; i < positions.size(); ++i) {
        const double at = positions[i];
        positions[i] = at + k_step;
        const double above = rigidity.evaluate(positions, unused);
        positions[i] = at - k_step;
        const double below = rigidity.evaluate(positions, unused);
        positions[i] = at;
        const double slope = (above - below) / (2 * k_step);
        norm += slope * slope;
        error += (slope - gradient[i]) * (slope - gradient[i]);
      }
      CHECK(norm > 1e-6);
      CHECK(std::sqrt(error / norm) < 1e-6);
    }
  }

  TEST_CASE("rigidity: a mesh without edges has none") {
    Mesh mesh;
    mesh.positions = {{1, 2, 3}};
    std::vector<double> gradient;
    CHECK(Rigidity(mesh, k_rigidity_weight).evaluate(std::vector<double>{4, 5, 6}, gradient) == 0);
    CHECK(gradient == std::vector<double>(3, 0));
  }
}

}  // namespace rigidity_test
