// The pose experiments: problems are what their set says, and the published protocol's derivative is one.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "dpr/error.hpp"
#include "experiments/pose/figures.hpp"
#include "experiments/pose/problems.hpp"
#include "experiments/pose/protocol.hpp"
#include "mesh/bounding_box.hpp"
#include "mesh/mesh_facts.hpp"
#include "mesh/solid.hpp"
#include "support/data.hpp"
#include "support/reduced.hpp"
#include "support/temp_dir.hpp"

namespace pose_experiments_test {

namespace {

using dpr::bench::PoseProblem;
using dpr::bench::PoseProblemSet;

/// Any smooth function of a rotation: <A, R>.
double linear_function(const glm::dmat3& a, const glm::dmat3& rotation) {
  return glm::dot(a[0], rotation[0]) + glm::dot(a[1], rotation[1]) + glm::dot(a[2], rotation[2]);
}

template <typename Function>
glm::dvec3 central_differences(const Function& f) {
  constexpr double k_step = 1e-5;
  glm::dvec3 result;
  for (int i = 0; i < 3; ++i) {
    glm::dvec3 step(0);
    step[i] = k_step;
    result[i] = (f(step) - f(-step)) / (2 * k_step);
  }
  return result;
}

}  // namespace

TEST_SUITE("gradient") {
  TEST_CASE("the rotation vector's gradient follows from that of a rotation on the left, at any angle") {
    const glm::dmat3 a(0.3, -1.2, 0.7, 2.1, 0.4, -0.5, -0.9, 1.1, 0.2);
    const glm::dvec3 axis = glm::normalize(glm::dvec3(1, -2, 0.5));
    for (const double angle : {0.0, 1e-6, 1e-3, 0.5, 2.0, 3.1, 4.5, 6.2}) {
      CAPTURE(angle);
      const glm::dvec3 r = angle * axis;
      const glm::dmat3 rotation = dpr::rotation_from_vector(r);
      const glm::dvec3 left = central_differences(
          [&](const glm::dvec3& d) { return linear_function(a, dpr::rotation_from_vector(d) * rotation); });
      const glm::dvec3 wanted = central_differences(
          [&](const glm::dvec3& d) { return linear_function(a, dpr::rotation_from_vector(r + d)); });
      const glm::dvec3 found = dpr::bench::rotation_vector_gradient(r, left);
      CHECK(glm::length(found - wanted) < 1e-7);
      if (angle >= 0.5) CHECK(glm::length(left - wanted) > 1e-2);  // they are not the same thing
    }
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("clutter does not count, however much wrong hypotheses leave: the robust scale is bounded") {
    if (dpr::test::is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = dpr::read_scene(dpr::test::data_folder() / "foreign" / "spot.json");
    scene.width = scene.height = 64;
    PoseProblemSet set;
    set.clutter = true;
    set.occluded = 0.2;
    dpr::LeastSquares method;
    method.robust = true;
    dpr::bench::RigidCamera camera(device, scene);
    for (PoseProblem problem : dpr::bench::make_pose_problems(set, 2)) {
      problem.truth.translation = glm::dvec3(scene.meshes.front().transform[3]);
      const dpr::Image target = dpr::bench::make_target(camera, set, problem);
      const dpr::PoseResult result = dpr::PoseSolver(device, scene, target, {.method = method}).search();
      CHECK(dpr::angle_degrees(result.pose.rotation, problem.truth.rotation) < 3);
    }
  }
}

TEST_SUITE("unit") {
  TEST_CASE("pose problems: the angle is what was asked for, and a file replays them to the bit") {
    PoseProblemSet set;
    set.initial_degrees = 50;
    set.translation_error = 0.1;
    set.seed = 7;
    const auto problems = dpr::bench::make_pose_problems(set, 5);
    REQUIRE(problems.size() == 5);
    for (const PoseProblem& problem : problems) {
      CHECK(dpr::angle_degrees(problem.initial.rotation, problem.truth.rotation) ==
            doctest::Approx(50).epsilon(1e-9));
      CHECK(glm::length(problem.initial.translation - problem.truth.translation) ==
            doctest::Approx(0.1 * dpr::bench::k_pose_camera_distance));
    }
    const dpr::test::TempDir folder;
    dpr::bench::write_pose_problems(folder / "problems.json", set, problems);
    PoseProblemSet read_set;
    const auto read = dpr::bench::read_pose_problems(folder / "problems.json", read_set);
    CHECK(read_set.seed == 7);
    REQUIRE(read.size() == problems.size());
    for (std::size_t i = 0; i < read.size(); ++i) {
      CHECK(read[i].truth.rotation == problems[i].truth.rotation);
      CHECK(read[i].initial.rotation == problems[i].initial.rotation);
      CHECK(read[i].initial.translation == problems[i].initial.translation);
      CHECK(read[i].seed == problems[i].seed);
    }
    folder.write("broken.json", "{\"set\": {}}");
    CHECK_THROWS_AS(dpr::bench::read_pose_problems(folder / "broken.json", read_set), dpr::IoError);
  }

  TEST_CASE("mailbox and bag: parts that are closed and wound outwards, in the box of the cube") {
    for (const char* const object : {"mailbox", "bag"}) {
      const dpr::Mesh mesh = dpr::bench::make_object(object);
      CHECK_NOTHROW(dpr::validate(mesh));
      const auto edges = dpr::make_edges(mesh.faces, mesh.positions.size());
      CHECK(dpr::Solid(edges, mesh.faces.size()).winding(mesh.positions, mesh.faces) == 1);
      CHECK(dpr::mesh_facts(mesh).components == 8);
      const auto [low, high] = dpr::bounding_box(mesh.positions);
      CHECK(glm::all(glm::greaterThanEqual(low, glm::vec3(-1))));
      CHECK(glm::all(glm::lessThanEqual(high, glm::vec3(1))));
    }
  }

  TEST_CASE("solved parts: counted strictly below the threshold") {
    const std::vector<double> angles{0.5, 1, 9.99, 10, 90};
    CHECK(dpr::bench::solved_part(angles, 1) == doctest::Approx(0.2));
    CHECK(dpr::bench::solved_part(angles, 10) == doctest::Approx(0.6));
    CHECK(dpr::bench::solved_part({}, 10) == 0);
  }

  TEST_CASE("figures: every run of a figure has a file of its own, unless it is the same run") {
    const dpr::bench::PoseRun common;
    for (const dpr::bench::Figure& figure : dpr::bench::figures()) {
      CAPTURE(figure.name);
      const auto panels = figure.panels(common, 1);
      CHECK(!panels.empty());
      std::vector<std::string> stems;
      for (const auto& panel : panels) {
        for (const auto& curve : panel.curves) {
          CHECK((curve.x.empty() ? std::size_t{1} : curve.x.size()) == curve.runs.size());
          for (const auto& run : curve.runs) stems.push_back(dpr::bench::file_stem(run));
        }
      }
      std::ranges::sort(stems);
      CHECK(std::ranges::adjacent_find(stems) == stems.end());
    }
  }
}

}  // namespace pose_experiments_test
