// The built-in shapes: closed, wound outwards, of the promised size and number of triangles.
#include <doctest/doctest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <set>
#include <tuple>

#include "dpr/mesh.hpp"
#include "support/messages.hpp"

namespace primitives_test {

using namespace dpr;

namespace {

// A part of a mesh: faces connected through equal positions.
struct Part {
  std::set<std::uint32_t> vertices;
  std::vector<glm::uvec3> faces;
  double volume = 0;
};

// Faces with one index for each position.
std::vector<glm::uvec3> welded(const Mesh& mesh) {
  std::map<std::tuple<float, float, float>, std::uint32_t> first;
  std::vector<std::uint32_t> index;
  for (const glm::vec3& p : mesh.positions) {
    index.push_back(
        first.try_emplace({p.x, p.y, p.z}, static_cast<std::uint32_t>(index.size())).first->second);
  }
  std::vector<glm::uvec3> faces;
  for (const glm::uvec3& f : mesh.faces) faces.emplace_back(index[f.x], index[f.y], index[f.z]);
  return faces;
}

std::vector<Part> parts_of(const Mesh& mesh) {
  std::vector<std::uint32_t> root(mesh.positions.size());
  std::iota(root.begin(), root.end(), 0U);
  const auto find = [&](std::uint32_t v) {
    while (root[v] != v) v = root[v] = root[root[v]];
    return v;
  };
  const std::vector<glm::uvec3> faces = welded(mesh);
  for (const glm::uvec3& f : faces) {
    root[find(f.y)] = find(f.x);
    root[find(f.z)] = find(f.x);
  }
  std::map<std::uint32_t, Part> parts;
  for (const glm::uvec3& f : faces) {
    Part& part = parts[find(f.x)];
    part.faces.push_back(f);
    part.vertices.insert({f.x, f.y, f.z});
    const glm::dvec3 a(mesh.positions[f.x]), b(mesh.positions[f.y]), c(mesh.positions[f.z]);
    part.volume += glm::dot(a, glm::cross(b, c)) / 6;
  }
  std::vector<Part> list;
  for (auto& [first, part] : parts) list.push_back(std::move(part));
  return list;
}

// Every edge is used once in each direction: closed, and wound alike everywhere.
bool is_closed(const Part& part) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> uses;
  for (const glm::uvec3& f : part.faces) {
    for (int i = 0; i < 3; ++i) ++uses[{f[i], f[(i + 1) % 3]}];
  }
  return std::all_of(uses.begin(), uses.end(), [&](const auto& use) {
    const auto opposite = uses.find({use.first.second, use.first.first});
    return use.second == 1 && opposite != uses.end() && opposite->second == 1;
  });
}

int euler_characteristic(const Part& part) {
  const auto faces = static_cast<int>(part.faces.size());
  return static_cast<int>(part.vertices.size()) - 3 * faces / 2 + faces;
}

void check_parts(const Mesh& mesh, std::size_t count, int characteristic) {
  CHECK_NOTHROW(validate(mesh));
  const std::vector<Part> parts = parts_of(mesh);
  CHECK(parts.size() == count);
  for (const Part& part : parts) {
    CHECK(is_closed(part));
    CHECK(part.volume > 0);  // wound outwards
    CHECK(euler_characteristic(part) == characteristic);
  }
}

std::size_t color_count(const Mesh& mesh) {
  std::set<std::tuple<float, float, float>> colors;
  for (const glm::vec3& c : mesh.face_colors) colors.emplace(c.r, c.g, c.b);
  return colors.size();
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("the checks see an open and an inverted shape") {
    Mesh open = make_cube();
    open.faces.pop_back();
    open.face_colors.pop_back();
    CHECK_FALSE(is_closed(parts_of(open)[0]));
    Mesh inverted = make_cube();
    for (glm::uvec3& f : inverted.faces) std::swap(f.x, f.y);
    CHECK(is_closed(parts_of(inverted)[0]));
    CHECK(parts_of(inverted)[0].volume < 0);
    std::swap(inverted.faces[0].x, inverted.faces[0].y);
    CHECK_FALSE(is_closed(parts_of(inverted)[0]));
  }

  TEST_CASE("cube") {
    const Mesh cube = make_cube();
    CHECK(cube.positions.size() == 24);
    CHECK(cube.faces.size() == 12);
    CHECK(color_count(cube) == 6);
    check_parts(cube, 1, 2);
    CHECK(parts_of(cube)[0].volume == doctest::Approx(8));
    for (std::size_t i = 0; i < 12; i += 2) CHECK(cube.face_colors[i] == cube.face_colors[i + 1]);
  }

  TEST_CASE("icosphere") {
    std::size_t faces = 20;
    for (unsigned level = 0; level <= 4; ++level, faces *= 4) {
      const Mesh sphere = make_icosphere(level, 2);
      CHECK(sphere.faces.size() == faces);
      CHECK(sphere.positions.size() == faces / 2 + 2);
      CHECK(sphere.vertex_colors.size() == sphere.positions.size());
      check_parts(sphere, 1, 2);
      for (const glm::vec3& p : sphere.positions) CHECK(glm::length(p) == doctest::Approx(2));
    }
    CHECK(parts_of(make_icosphere(4))[0].volume == doctest::Approx(4.18879).epsilon(0.01));
  }

  TEST_CASE("torus") {
    const Mesh torus = make_torus(1, 0.25F, 64, 32);
    CHECK(torus.faces.size() == 2 * 64 * 32);
    CHECK(torus.positions.size() == 64 * 32);
    check_parts(torus, 1, 0);
    CHECK(parts_of(torus)[0].volume == doctest::Approx(1.2337).epsilon(0.02));  // 2 pi^2 R r^2
    for (const glm::vec3& p : torus.positions) CHECK(std::abs(p.y) <= 0.25F);   // about the y axis
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("sizes out of range") {
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, make_icosphere(11), "subdivisions (make_icosphere): got 11");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, make_icosphere(1, 0), "radius (make_icosphere): got 0");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, make_torus(-1, 1, 8, 8), "major_radius (make_torus): got -1");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, make_torus(1, 1, 2, 8), "segments (make_torus): got 2");
  }
}

}  // namespace primitives_test
