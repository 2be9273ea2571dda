// The pose solver on the coloured cube, and what it refuses.
#include "dpr/pose.hpp"

#include <doctest/doctest.h>

#include <cstdlib>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>

#include "dpr/error.hpp"
#include "dpr/renderer.hpp"

namespace {

bool reduced() { return std::getenv("DPR_TEST_REDUCED") != nullptr; }

dpr::Scene cube_scene(int size) {
  dpr::Scene scene;
  scene.width = scene.height = size;
  scene.camera = dpr::orbit_camera(6.7F, 30, 120);
  scene.meshes.push_back({dpr::make_cube(), glm::mat4(1.0F)});
  return scene;
}

dpr::Image rigid_target(const dpr::Device& device, dpr::Scene scene) {
  scene.smoothing = dpr::rigid_smoothing();
  dpr::Renderer renderer(device);
  renderer.set_scene(scene);
  renderer.forward();
  return renderer.image();
}

const glm::dvec3 k_axis = glm::normalize(glm::dvec3(1, 2, -1));

dpr::Pose turned(double degrees) { return {dpr::rotation_from_vector(glm::radians(degrees) * k_axis), {}}; }

dpr::PoseOptions options(unsigned iterations) {
  dpr::PoseOptions result;
  result.iterations = iterations;
  if (reduced()) result.restarts = 0;
  return result;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("from 30 degrees the cube's rotation is found") {
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = cube_scene(reduced() ? 16 : 64);
    const dpr::PoseSolver solver(device, scene, rigid_target(device, scene), options(reduced() ? 3 : 200));
    const dpr::PoseResult result = solver.solve(turned(30));
    if (!reduced()) CHECK(result.explained);  // losses of different smoothing do not compare
    CHECK(result.iterations == result.history.size());
    CHECK(result.seconds > 0);
    const double error = dpr::angle_degrees(result.pose.rotation, glm::dmat3(1.0));
    CHECK(error < (reduced() ? 30.0 : 3.0));
  }

  TEST_CASE("the translation is found too, and the scale of the transform is kept apart") {
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = cube_scene(reduced() ? 16 : 64);
    glm::mat4& transform = scene.meshes.front().transform;
    transform = glm::translate(glm::mat4(1.0F), glm::vec3(0.3F, -0.2F, 0.1F)) *
                glm::rotate(glm::mat4(1.0F), 0.4F, glm::vec3(k_axis)) *
                glm::scale(glm::mat4(1.0F), glm::vec3(0.8F));
    // Sizes must tell distances: this composition neither swells nor cuts its skirt off at the blur radius.
    scene.smoothing = dpr::smoothing_preset("joint_gaussian");
    dpr::PoseOptions with_translation = options(reduced() ? 3 : 400);
    with_translation.solve_translation = true;
    const dpr::PoseSolver solver(device, scene, rigid_target(device, scene), with_translation);

    const dpr::Pose truth = solver.scene_pose();
    CHECK(dpr::angle_degrees(truth.rotation, dpr::rotation_from_vector(0.4 * k_axis)) < 1e-4);
    CHECK(glm::length(truth.translation - glm::dvec3(0.3, -0.2, 0.1)) < 1e-6);

    dpr::Pose start = truth;
    start.rotation = turned(15).rotation * start.rotation;
    start.translation += glm::dvec3(-0.1, 0.1, 0.1);
    const dpr::PoseResult result = solver.solve(start);
    if (reduced()) return;
    CHECK(result.explained);
    CHECK(dpr::angle_degrees(result.pose.rotation, truth.rotation) < 3);
    CHECK(glm::length(result.pose.translation - truth.translation) < 0.15);  // 2% of the distance
  }

  TEST_CASE("the best pose is the best of the last smoothing level") {
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = cube_scene(16);
    dpr::PoseOptions eager = options(reduced() ? 4 : 30);
    eager.schedule = dpr::AdaptiveSchedule{.start = 1, .interval = 1};
    eager.restarts = 0;
    const dpr::PoseSolver solver(device, scene, rigid_target(device, scene), eager);
    const dpr::PoseResult result = solver.solve(turned(20));
    for (const dpr::PoseIteration& step : result.history) {
      if (step.sigma == result.history.back().sigma) CHECK(result.loss <= step.loss);
    }
  }

  TEST_CASE("a callback that returns false stops the solver at once") {
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = cube_scene(16);
    const dpr::PoseSolver solver(device, scene, rigid_target(device, scene), options(10));
    const dpr::PoseResult result =
        solver.solve(turned(20), [](const dpr::PoseIteration& step) { return step.iteration < 2; });
    CHECK(result.iterations == 3);
    CHECK(result.history.front().sigma == scene.smoothing.sigma);
    CHECK(dpr::angle_degrees(result.history.front().pose.rotation, turned(20).rotation) < 1e-9);
  }

  TEST_CASE("a solver's answer is the same every time") {
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = cube_scene(16);
    scene.smoothing = dpr::smoothing_preset("paper_gaussian");
    const dpr::PoseSolver solver(device, scene, rigid_target(device, scene), options(4));
    const dpr::PoseResult first = solver.solve(turned(20)), second = solver.solve(turned(20));
    CHECK(first.loss == second.loss);
    CHECK(first.pose.rotation == second.pose.rotation);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("what cannot be solved is refused before any work") {
    const dpr::Device device = dpr::open_device();
    const dpr::Image target(16, 16);
    const dpr::Scene good = cube_scene(16);
    const auto refuses = [&](const dpr::Scene& scene, const dpr::Image& image,
                             const dpr::PoseOptions& wanted) {
      CHECK_THROWS_AS(dpr::PoseSolver(device, scene, image, wanted), dpr::InvalidArgument);
    };

    refuses(good, dpr::Image(16, 17), {});
    dpr::Scene scene = good;
    scene.meshes.push_back(scene.meshes.front());
    refuses(scene, target, {});
    scene.meshes.clear();
    refuses(scene, target, {});
    scene = good;
    scene.meshes.front().transform[1] = glm::vec4(0);
    refuses(scene, target, {});

    refuses(good, target, options(0));
    dpr::PoseOptions wrong;
    wrong.optimizer.learning_rate = -1;
    refuses(good, target, wrong);
    wrong = {};
    wrong.schedule = dpr::AdaptiveSchedule{.interval = 0};
    refuses(good, target, wrong);
    wrong = {};
    wrong.schedule = dpr::AnnealSchedule{.levels = 0};
    refuses(good, target, wrong);
    wrong = {};
    wrong.explained = 1;
    refuses(good, target, wrong);
  }

  TEST_CASE("an initial rotation that is none is refused") {
    const dpr::PoseSolver solver(dpr::open_device(), cube_scene(16), dpr::Image(16, 16));
    CHECK_THROWS_AS(solver.solve({glm::dmat3(2.0), {}}), dpr::InvalidArgument);
    CHECK_THROWS_AS(solver.solve({glm::dmat3(-1.0), {}}), dpr::InvalidArgument);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    CHECK_THROWS_AS(solver.solve({glm::dmat3(nan), {}}), dpr::InvalidArgument);
  }
}
