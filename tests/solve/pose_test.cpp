// The pose solver on the coloured cube: both methods, and what it refuses.
#include "dpr/pose.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <utility>

#include "dpr/error.hpp"
#include "dpr/renderer.hpp"
#include "dpr/subdivision.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"
#include "support/rigid_image.hpp"

namespace pose_test {

namespace {

using dpr::test::is_reduced;
using dpr::test::reduced;
using dpr::test::rigid_image;

dpr::Scene cube_scene(int size) {
  dpr::Scene scene;
  scene.width = scene.height = size;
  scene.camera = dpr::orbit_camera(6.7F, 30, 120);
  scene.meshes.push_back({dpr::make_cube(), glm::mat4(1.0F)});
  scene.smoothing = dpr::smoothing_preset("joint_gaussian");
  return scene;
}

const glm::dvec3 k_axis = glm::normalize(glm::dvec3(1, 2, -1));

dpr::Pose turned(double degrees, const glm::dvec3& axis = k_axis) {
  return {dpr::rotation_from_vector(glm::radians(degrees) * axis), {}};
}

dpr::LeastSquares least_squares() {
  dpr::LeastSquares method;
  if (is_reduced()) method.rotations = 2, method.iterations = 1, method.coarsest = 8;
  return method;
}

dpr::PoseOptions descent(unsigned iterations) {
  dpr::Descent method;
  method.iterations = iterations;
  if (is_reduced()) method.restarts = 0;
  return {.method = method};
}

double error_degrees(const dpr::PoseResult& result, const dpr::Pose& truth = {}) {
  return dpr::angle_degrees(result.pose.rotation, truth.rotation);
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("least squares: the cube's rotation is found from afar, and its error is known") {
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = cube_scene(reduced(64, 8));
    const dpr::PoseSolver solver(device, scene, rigid_image(device, scene), {.method = least_squares()});
    unsigned calls = 0;
    const dpr::PoseResult result = solver.solve(turned(110), [&](const dpr::PoseIteration& step) {
      CHECK(step.iteration == calls);
      ++calls;
      return true;
    });
    CHECK(result.iterations == calls);
    CHECK(result.iterations == result.history.size());
    CHECK(result.iterations <= solver.most_iterations());
    CHECK(result.history.back().width == scene.width);
    CHECK(dpr::angle_degrees(result.start.rotation, turned(110).rotation) < 1e-6);
    CHECK(result.seconds > 0);
    if (is_reduced()) return;
    CHECK(error_degrees(result) < 0.5);
    CHECK(result.explained);
    CHECK(result.equals.size() == 1);
    REQUIRE(result.covariance.size() == 9);
    const double deviation = std::sqrt(result.covariance[0] + result.covariance[4] + result.covariance[8]);
    CHECK(glm::degrees(deviation) > 0.01);
    CHECK(error_degrees(result) < 4 * glm::degrees(deviation));
  }

  TEST_CASE("least squares: nothing needs to be known of the rotation") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = cube_scene(64);
    for (const double degrees : {70.0, 140.0}) {
      scene.meshes.front().transform = glm::mat4(glm::dmat4(turned(degrees).rotation));
      const dpr::Image target = rigid_image(device, scene);
      scene.meshes.front().transform = glm::mat4(1.0F);
      const dpr::PoseResult result =
          dpr::PoseSolver(device, scene, target, {.method = least_squares()}).search();
      CHECK(error_degrees(result, turned(degrees)) < 0.5);
      CHECK(result.explained);
    }
  }

  TEST_CASE("least squares: translation and scale") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = cube_scene(64);
    glm::mat4& transform = scene.meshes.front().transform;
    transform = glm::translate(glm::mat4(1.0F), glm::vec3(0.3F, -0.2F, 0.1F)) *
                glm::rotate(glm::mat4(1.0F), 0.4F, glm::vec3(k_axis)) *
                glm::scale(glm::mat4(1.0F), glm::vec3(0.8F));
    const dpr::PoseSolver solver(device, scene, rigid_image(device, scene),
                                 {.method = least_squares(), .solve_translation = true});
    const dpr::Pose truth = solver.scene_pose();
    CHECK(dpr::angle_degrees(truth.rotation, dpr::rotation_from_vector(0.4 * k_axis)) < 1e-4);
    CHECK(glm::length(truth.translation - glm::dvec3(0.3, -0.2, 0.1)) < 1e-6);

    dpr::Pose start = truth;
    start.rotation = turned(50).rotation * start.rotation;
    start.translation += glm::dvec3(-0.4, 0.3, 0.3);  // 9% of the distance
    const dpr::PoseResult result = solver.solve(start);
    CHECK(result.explained);
    CHECK(error_degrees(result, truth) < 1);
    CHECK(glm::length(result.pose.translation - truth.translation) < 0.05);
    REQUIRE(result.covariance.size() == 36);
    for (int axis = 0; axis < 3; ++axis) {
      const double deviation = std::sqrt(result.covariance[static_cast<std::size_t>(7 * (axis + 3))]);
      CHECK(std::abs(result.pose.translation[axis] - truth.translation[axis]) < 5 * deviation);
    }
  }

  TEST_CASE("least squares: the focal length") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = cube_scene(64);
    const dpr::Image target = rigid_image(device, scene);
    scene.camera.fov_y_degrees = 66;
    const dpr::PoseSolver solver(device, scene, target, {.method = least_squares(), .solve_focal = true});
    const dpr::PoseResult result = solver.solve(turned(30));
    CHECK(error_degrees(result) < 1);
    const double expected = std::tan(glm::radians(33.0)) / std::tan(glm::radians(30.0));
    CHECK(result.focal_scale == doctest::Approx(expected).epsilon(0.01));
  }

  TEST_CASE("least squares: focal length and distortion") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = cube_scene(96);
    scene.camera = dpr::orbit_camera(3.2F, 30, 120);  // near, so that the picture bends
    scene.camera.fov_y_degrees = 70;
    scene.camera.distortion = dpr::Distortion{-0.2F, 0.05F};
    const dpr::Image target = rigid_image(device, dpr::subdivide_for_lens(scene).scene);
    scene.camera.distortion.reset();
    scene.camera.fov_y_degrees = 74;
    const dpr::PoseSolver solver(device, scene, target,
                                 {.method = least_squares(), .solve_focal = true, .solve_distortion = true});
    const dpr::PoseResult result = solver.solve(turned(5));
    CHECK(result.explained);
    CHECK(error_degrees(result) < 0.5);
    const double expected = std::tan(glm::radians(37.0)) / std::tan(glm::radians(35.0));
    CHECK(result.focal_scale == doctest::Approx(expected).epsilon(0.01));
    CHECK(result.radial.x == doctest::Approx(-0.2).epsilon(0.1));
    REQUIRE(result.covariance.size() == 36);
    const dpr::Camera found = dpr::calibrated(scene.camera, result.focal_scale, result.radial);
    CHECK(static_cast<double>(found.distortion->k1) == doctest::Approx(result.radial.x));
    CHECK(static_cast<double>(found.fov_y_degrees) == doctest::Approx(70).epsilon(0.01));
  }

  TEST_CASE("both methods: faces are cut where the scene's lens bends their edges") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = cube_scene(96);
    scene.camera = dpr::orbit_camera(2.6F, 30, 120);  // each side fills a third of the picture
    scene.camera.fov_y_degrees = 90;
    scene.camera.znear = 0.5F;
    scene.camera.distortion = dpr::Distortion{-0.3F, 0.05F};
    const dpr::Image target = rigid_image(device, dpr::subdivide_for_lens(scene, {.tolerance = 0.02F}).scene);
    const dpr::Pose start{turned(3).rotation, {0.03, 0.02, -0.03}};
    dpr::LeastSquares method = least_squares();
    method.rotations = 0;
    for (const dpr::PoseOptions& options :
         {dpr::PoseOptions{.method = method, .solve_translation = true},
          dpr::PoseOptions{.method = dpr::Descent{}, .solve_translation = true}}) {
      const dpr::PoseResult result = dpr::PoseSolver(device, scene, target, options).solve(start);
      CHECK(error_degrees(result) < 0.5);
      CHECK(glm::length(result.pose.translation) < 0.03);  // with whole faces 0.09
    }
  }

  TEST_CASE("least squares: all poses that give the image are told, the nearest one first") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = cube_scene(64);
    scene.camera = dpr::orbit_camera(6.7F, 4, 5);  // sees one side alone: four rotations show the same
    const glm::dvec3 normal(0, 0, 1);
    const double first = 11;  // no edge along the pixels' grid
    scene.meshes.front().transform = glm::mat4(glm::dmat4(turned(first, normal).rotation));
    const dpr::PoseSolver solver(device, scene, rigid_image(device, scene));
    for (const double degrees : {0.0, 90.0, 180.0, 270.0}) {
      const dpr::PoseResult result = solver.solve(turned(first + degrees + 20, normal));
      CHECK(result.equals.size() == 4);
      CHECK(error_degrees(result, turned(first + degrees, normal)) < 2);
      for (const double other : {0.0, 90.0, 180.0, 270.0}) {
        CHECK(std::ranges::any_of(result.equals, [&](const dpr::PoseHypothesis& found) {
          return dpr::angle_degrees(found.pose.rotation, turned(first + other, normal).rotation) < 2;
        }));
      }
    }
  }

  TEST_CASE("least squares: of more equal poses than are kept, the one nearest to the start is the result") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = cube_scene(64);
    scene.meshes.front().mesh.face_colors.assign(12, glm::vec3(0.8F));
    dpr::Lights lights;  // which tells the sides apart, whichever side they are: 24 rotations show the same
    lights.point = {{.position = {3, 5, -4}, .diffuse = glm::vec3(0.5F)}};
    scene.lights = lights;
    scene.meshes.front().transform = glm::mat4(glm::dmat4(turned(40).rotation));
    const dpr::PoseSolver solver(device, scene, rigid_image(device, scene));
    for (const double degrees : {40.5, 35.0}) {
      const dpr::PoseResult result = solver.solve(turned(degrees));
      CHECK(result.equals.size() > 4);
      CHECK(error_degrees(result, turned(40)) < 1);
    }
  }

  TEST_CASE("least squares: a hidden part misleads unless it is masked or the loss is robust") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = cube_scene(64);
    dpr::Image target = rigid_image(device, scene);
    dpr::Image mask(scene.width, scene.height, glm::vec4(1));
    for (int row = 0; row < scene.height; ++row) {
      for (int column = scene.width * 9 / 16; column < scene.width; ++column) {
        target.at(column, row) = glm::vec4(0.9F, 0.1F, 0.8F, 1);
        mask.at(column, row) = glm::vec4(0);
      }
    }
    const auto error = [&](const dpr::LeastSquares& method) {
      return error_degrees(dpr::PoseSolver(device, scene, target, {.method = method}).solve(turned(40)));
    };
    dpr::LeastSquares masked = least_squares(), robust = least_squares();
    masked.mask = mask;
    robust.robust = true;
    const std::array errors{error(least_squares()), error(masked), error(robust)};
    CHECK(errors[0] > 5);
    CHECK(errors[1] < 1);
    CHECK(errors[2] < 3);
  }

  TEST_CASE("least squares: triangles much smaller than the coarse pixels are no hindrance") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = cube_scene(64);
    dpr::Mesh& mesh = scene.meshes.front().mesh;
    mesh = dpr::make_icosphere(4);
    for (glm::vec3& p : mesh.positions) p *= glm::vec3(1.6F, 1.0F, 0.6F);
    const dpr::PoseSolver solver(device, scene, rigid_image(device, scene), {.method = least_squares()});
    const dpr::PoseResult result = solver.solve(turned(70));
    // The right valley; the seams between so many triangles move its bottom.
    CHECK(error_degrees(result) < 4);
  }

  TEST_CASE("least squares: several initial poses and no others") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = cube_scene(64);
    dpr::LeastSquares local = least_squares();
    local.rotations = 0;
    const dpr::PoseSolver solver(device, scene, rigid_image(device, scene), {.method = local});
    const std::array<dpr::Pose, 2> poses{turned(150), turned(15)};
    const dpr::PoseResult result = solver.solve(poses);
    CHECK(result.history.front().hypotheses == 2);
    CHECK_THROWS_AS(solver.search(), dpr::InvalidArgument);
    CHECK(error_degrees(result) < 0.5);
    CHECK(error_degrees(solver.solve(turned(150))) > 30);  // one valley, and that a wrong one
  }

  TEST_CASE("least squares: coarse images do not lead away from a start that is nearly right") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = cube_scene(64);
    scene.width = 72;
    scene.camera.fov_y_degrees = 60;
    scene.camera.view = glm::lookAt(glm::vec3(0, 2.16F, 2.88F), glm::vec3(0), glm::vec3(0, 1, 0));
    const dpr::Pose truth = turned(22.9, {0, 1, 0});
    scene.meshes.front().transform = glm::mat4(glm::dmat4(truth.rotation));
    dpr::LeastSquares local = least_squares();
    local.rotations = 0;
    const dpr::PoseSolver solver(device, scene, rigid_image(device, scene),
                                 {.method = local, .solve_translation = true});
    const dpr::PoseResult result = solver.solve(turned(21.2, {0, 1, 0}));
    CHECK(error_degrees(result, truth) < 0.5);  // 2.5 from the coarse images alone
    CHECK(glm::length(result.pose.translation) < 0.02);
  }

  TEST_CASE("descent: from 30 degrees the cube's rotation is found") {
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = cube_scene(reduced(64, 8));
    const dpr::PoseSolver solver(device, scene, rigid_image(device, scene), descent(is_reduced() ? 3 : 200));
    const dpr::PoseResult result = solver.solve(turned(30));
    if (!is_reduced()) CHECK(result.explained);  // losses of different smoothing do not compare
    CHECK(result.iterations == result.history.size());
    CHECK(result.seconds > 0);
    CHECK(error_degrees(result) < (is_reduced() ? 30.0 : 3.0));
  }

  TEST_CASE("descent: the translation is found too") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = cube_scene(64);
    dpr::PoseOptions options = descent(400);
    options.solve_translation = true;
    const dpr::PoseSolver solver(device, scene, rigid_image(device, scene), options);
    dpr::Pose start = turned(15);
    start.translation = glm::dvec3(-0.1, 0.1, 0.1);
    const dpr::PoseResult result = solver.solve(start);
    CHECK(result.explained);
    CHECK(error_degrees(result) < 3);
    CHECK(glm::length(result.pose.translation) < 0.15);  // 2% of the distance
  }

  TEST_CASE("descent: the best pose is the best of the last smoothing level") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = cube_scene(16);
    dpr::PoseOptions eager = descent(30);
    std::get<dpr::Descent>(eager.method).schedule = dpr::AdaptiveSchedule{.start = 1, .interval = 1};
    std::get<dpr::Descent>(eager.method).restarts = 0;
    const dpr::PoseSolver solver(device, scene, rigid_image(device, scene), eager);
    const dpr::PoseResult result = solver.solve(turned(20));
    for (const dpr::PoseIteration& step : result.history) {
      if (step.smoothing.sigma == result.history.back().smoothing.sigma) CHECK(result.loss <= step.loss);
    }
  }

  TEST_CASE("a callback that returns false stops the solver at once") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = cube_scene(16);
    const dpr::Image target = rigid_image(device, scene);
    const auto stop = [](const dpr::PoseIteration& step) { return step.iteration < 1; };
    const dpr::PoseResult descended =
        dpr::PoseSolver(device, scene, target, descent(10)).solve(turned(20), stop);
    CHECK(descended.iterations == 2);
    CHECK(descended.history.front().smoothing.sigma == scene.smoothing.sigma);
    CHECK(dpr::angle_degrees(descended.history.front().pose.rotation, turned(20).rotation) < 1e-9);

    dpr::LeastSquares method = least_squares();
    method.rotations = 2;
    const dpr::PoseResult fitted =
        dpr::PoseSolver(device, scene, target, {.method = method}).solve(turned(20), stop);
    CHECK(fitted.iterations == 2);
    CHECK(std::isfinite(fitted.loss));
  }

  TEST_CASE("a solver's answer is the same every time") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = cube_scene(16);
    const dpr::Image target = rigid_image(device, scene);
    scene.smoothing = dpr::smoothing_preset("paper_gaussian");
    dpr::LeastSquares method = least_squares();
    method.rotations = 16;
    for (const dpr::PoseOptions& options : {descent(4), dpr::PoseOptions{.method = method}}) {
      const dpr::PoseSolver solver(device, scene, target, options);
      const dpr::PoseResult first = solver.solve(turned(20)), second = solver.solve(turned(20));
      CHECK(first.loss == second.loss);
      CHECK(first.pose.rotation == second.pose.rotation);
    }
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
    const auto refuses_descent = [&](auto change) {
      dpr::Descent method;
      change(method);
      refuses(good, target, {.method = method});
    };
    const auto refuses_least_squares = [&](auto change) {
      dpr::LeastSquares method;
      change(method);
      refuses(good, target, {.method = method});
    };
    const float nan = std::numeric_limits<float>::quiet_NaN();

    refuses(good, dpr::Image(16, 17), {});
    refuses(good, dpr::Image(16, 16, glm::vec4(nan)), {});
    dpr::Scene scene = good;
    scene.meshes.push_back(scene.meshes.front());
    refuses(scene, target, {});
    scene.meshes.clear();
    refuses(scene, target, {});
    scene = good;
    scene.meshes.front().transform[1] = glm::vec4(0);
    refuses(scene, target, {});
    refuses(good, target, {.method = dpr::LeastSquares{}, .explained = 1});
    refuses(good, target, {.method = dpr::Descent{}, .solve_focal = true});
    refuses(good, target, {.method = dpr::Descent{}, .solve_distortion = true});
    dpr::Scene orthographic = good;
    orthographic.camera.orthographic_height = 4.0F;
    refuses(orthographic, target, {.method = least_squares(), .solve_distortion = true});
    refuses(orthographic, target, {.method = least_squares(), .solve_translation = true});

    refuses_descent([](dpr::Descent& d) { d.iterations = 0; });
    refuses_descent([](dpr::Descent& d) { d.optimizer.learning_rate = -1; });
    refuses_descent([](dpr::Descent& d) { d.schedule = dpr::AdaptiveSchedule{.interval = 0}; });
    refuses_descent([](dpr::Descent& d) { d.schedule = dpr::AnnealSchedule{.levels = 0}; });

    refuses_least_squares([](dpr::LeastSquares& m) { m.rotations = 1U << 25; });
    refuses_least_squares([](dpr::LeastSquares& m) { m.coarsest = 0; });
    refuses_least_squares([](dpr::LeastSquares& m) { m.iterations = 0; });
    refuses_least_squares([](dpr::LeastSquares& m) { m.blur = 0; });
    refuses_least_squares([&](dpr::LeastSquares& m) { m.blur_end = nan; });
    refuses_least_squares([](dpr::LeastSquares& m) { m.robust_scale = -1; });
    refuses_least_squares([](dpr::LeastSquares& m) { m.mask = dpr::Image(16, 17, glm::vec4(1)); });
    refuses_least_squares([](dpr::LeastSquares& m) { m.mask = dpr::Image(16, 16, glm::vec4(0)); });
    refuses_least_squares([](dpr::LeastSquares& m) { m.mask = dpr::Image(16, 16, glm::vec4(2)); });
  }

  TEST_CASE("an initial rotation that is none is refused, and so is a search by descent") {
    const dpr::Device device = dpr::open_device();
    for (const dpr::PoseOptions& options : {dpr::PoseOptions{}, descent(1)}) {
      const dpr::PoseSolver solver(device, cube_scene(16), dpr::Image(16, 16), options);
      CHECK_THROWS_AS(solver.solve({glm::dmat3(2.0), {}}), dpr::InvalidArgument);
      CHECK_THROWS_AS(solver.solve({glm::dmat3(-1.0), {}}), dpr::InvalidArgument);
      const double nan = std::numeric_limits<double>::quiet_NaN();
      CHECK_THROWS_AS(solver.solve({glm::dmat3(nan), {}}), dpr::InvalidArgument);
      DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, solver.solve({glm::dmat3(1.0), glm::dvec3(0, 0, nan)}),
                            "initial translation (pose)");
      CHECK_THROWS_AS(solver.solve(std::span<const dpr::Pose>()), dpr::InvalidArgument);
    }
    const dpr::PoseSolver descending(device, cube_scene(16), dpr::Image(16, 16), descent(1));
    CHECK_THROWS_AS(descending.search(), dpr::InvalidArgument);
  }

  TEST_CASE("an image of nothing has an answer: finite, not explained, nothing known of its error") {
    const dpr::Device device = dpr::open_device();
    const int size = reduced(16, 8);
    dpr::Scene scene = cube_scene(size);
    scene.meshes.front().transform[3] = glm::vec4(0, 100, 0, 1);  // out of sight
    dpr::LeastSquares method = least_squares();
    method.rotations = 2;
    const dpr::PoseResult result =
        dpr::PoseSolver(device, scene, dpr::Image(size, size, glm::vec4(0.5F)), {.method = method}).search();
    CHECK(std::isfinite(result.loss));
    CHECK_FALSE(result.explained);
    CHECK(result.covariance.empty());
  }

  TEST_CASE("least squares: a mesh far from its own origin is found as one about it") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = cube_scene(64);
    glm::mat4& transform = scene.meshes.front().transform;
    transform = glm::rotate(glm::mat4(1.0F), glm::radians(100.0F), glm::vec3(k_axis)) *
                glm::scale(glm::mat4(1.0F), glm::vec3(0.9F, 1.1F, 1.0F));
    const dpr::Image target = rigid_image(device, scene);
    transform = glm::mat4(glm::mat3(glm::scale(glm::mat4(1.0F), glm::vec3(0.9F, 1.1F, 1.0F))));
    const dpr::PoseOptions options{.method = least_squares(), .solve_translation = true};
    const dpr::PoseResult about_origin = dpr::PoseSolver(device, scene, target, options).search();

    const glm::vec3 far(4, 4, 4);
    for (glm::vec3& p : scene.meshes.front().mesh.positions) p += far;
    transform[3] = transform * glm::vec4(-far, 1);  // the middle is at the same place
    std::vector<dpr::PoseIteration> reported;
    const dpr::PoseResult result =
        dpr::PoseSolver(device, scene, target, options).search([&](const dpr::PoseIteration& step) {
          reported.push_back(step);
          return true;
        });
    CHECK(result.explained);
    CHECK(dpr::angle_degrees(result.pose.rotation, about_origin.pose.rotation) < 0.05);
    const glm::dvec3 arm = result.pose.rotation * (glm::dvec3(0.9, 1.1, 1.0) * glm::dvec3(far));
    CHECK(glm::length(result.pose.translation + arm - about_origin.pose.translation) < 0.005);
    CHECK(glm::length(result.start.translation - glm::dvec3(transform[3])) < 1e-5);
    CHECK(reported.back().pose.translation == result.history.back().pose.translation);
    // The origin swings at the end of the arm, so its place is less certain by that much than the middle's.
    REQUIRE(result.covariance.size() == 36);
    double of_turn = 0, of_origin = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      of_turn += result.covariance[7 * axis];
      of_origin += result.covariance[7 * (axis + 3)];
    }
    const double ratio = of_origin / (of_turn * glm::dot(arm, arm));
    CHECK(ratio > 0.3);  // of the three axes two, at most, swing the arm
    CHECK(ratio < 3);
  }

  TEST_CASE("a target without the object is never explained, wherever the object goes and in any light") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    const int size = 32;
    dpr::LeastSquares method;
    method.rotations = 8;
    for (const float grey : {0.0F, 0.5F, 1.0F}) {
      for (const float height : {0.0F, 100.0F}) {  // in sight; out of it
        for (const dpr::PoseLight light : {dpr::PoseLight::fixed, dpr::PoseLight::harmonics}) {
          CAPTURE(grey);
          CAPTURE(height);
          dpr::Scene scene = cube_scene(size);
          scene.meshes.front().transform[3] = glm::vec4(0, height, 0, 1);
          method.light = light;
          const dpr::Image target(size, size, glm::vec4(glm::vec3(grey), 1));
          const dpr::PoseSolver solver(device, scene, target, {.method = method, .solve_translation = true});
          const dpr::PoseResult found = solver.search();
          CHECK_FALSE(found.explained);
          CHECK(found.doubt != dpr::PoseDoubt::none);
          // All of what an empty picture leaves stays, or more: nothing of the target is explained.
          if (height > 0) CHECK(found.unexplained_part >= 0.9);
        }
      }
    }
    dpr::Scene far = cube_scene(size);
    far.meshes.front().transform[3] = glm::vec4(0, 100, 0, 1);
    const dpr::PoseSolver solver(device, far, dpr::Image(size, size, glm::vec4(0)), descent(1));
    const dpr::PoseResult descended = solver.solve(solver.scene_pose());
    CHECK_FALSE(descended.explained);
    CHECK(descended.doubt == dpr::PoseDoubt::wrong_poses);
  }
}

}  // namespace pose_test
