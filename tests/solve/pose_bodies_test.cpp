// Poses in scenes of several meshes: some stand still, some move together.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <vector>

#include "dpr/pose.hpp"
#include "dpr/renderer.hpp"
#include "solve/pose_body.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"
#include "support/rigid_image.hpp"

namespace pose_bodies_test {

namespace {

using dpr::test::is_reduced;
using dpr::test::rigid_image;

glm::mat4 placed(const glm::vec3& place, const glm::vec3& turn, const glm::vec3& size) {
  const glm::mat4 rotation(glm::dmat4(dpr::rotation_from_vector(turn)));
  return glm::translate(glm::mat4(1), place) * rotation * glm::scale(glm::mat4(1), size);
}

/// A block of one colour, in front of a coloured cube and a second, smaller one beside that.
constexpr std::size_t k_block = 0, k_cube = 1, k_small = 2;

dpr::Scene three_meshes(int size) {
  dpr::Scene scene;
  scene.width = scene.height = size;
  scene.camera.view = glm::lookAt(glm::vec3(0, 2, 7), glm::vec3(0), glm::vec3(0, 1, 0));
  scene.camera.fov_y_degrees = 45;
  dpr::Mesh block = dpr::make_cube();
  block.face_colors.assign(block.faces.size(), glm::vec3(0.5F, 0.45F, 0.4F));
  block.vertex_colors.clear();
  scene.meshes = {{block, placed({0.3F, 0.6F, 2}, {0, 0.3F, 0}, {0.5F, 0.9F, 0.2F})},
                  {dpr::make_cube(), placed({-0.2F, 0, 0}, {0.2F, 0.5F, 0}, glm::vec3(0.9F))},
                  {{}, placed({1.4F, -0.8F, 0.3F}, {0, 0.9F, 0.3F}, {0.5F, 0.3F, 0.4F}), k_cube}};
  return scene;
}

dpr::LeastSquares near_start() {
  dpr::LeastSquares method;
  method.rotations = 24;
  method.light = dpr::PoseLight::fixed;
  return method;
}

dpr::Pose moved(const dpr::Pose& pose, const glm::dvec3& turn, const glm::dvec3& shift) {
  return {dpr::rotation_from_vector(turn) * pose.rotation, pose.translation + shift};
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("a body moves its meshes alone, as one, and its gradient is the adjoint of its tangents") {
    const dpr::Scene scene = three_meshes(8);
    const dpr::PoseBody body(scene, std::array{k_small, k_block});
    for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
      const glm::mat4 back = body.transforms(body.pose())[i] - scene.meshes[i].transform;
      for (int c = 0; c < 4; ++c) CHECK(glm::length(back[c]) < 1e-5F);
    }
    CHECK(body.points(scene).size() == 48);

    constexpr double k_step = 1e-3;
    const std::array<dpr::PoseGradient, 3> weights{
        {{{1, 2, 3}, {0.5, -1, 2}}, {}, {{-1, 0.2, 1}, {3, 1, -2}}}};
    const dpr::PoseGradient sum = body.gradient(body.pose(), weights);
    for (int axis = 0; axis < 3; ++axis) {
      const glm::dvec3 unit = glm::dmat3(1)[axis];
      const auto turning = body.turning(body.pose(), unit), shifting = body.shifting(unit);
      const auto more = body.transforms(moved(body.pose(), k_step * unit, {})),
                 less = body.transforms(moved(body.pose(), -k_step * unit, {}));
      double by_turn = 0, by_shift = 0;
      for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
        const glm::dvec3 speed = (glm::dvec3(more[i][3]) - glm::dvec3(less[i][3])) / (2 * k_step);
        CHECK(glm::length(speed - turning[i].translation) < 1e-3);
        by_turn += glm::dot(weights[i].rotation, turning[i].rotation) +
                   glm::dot(weights[i].translation, turning[i].translation);
        by_shift += glm::dot(weights[i].translation, shifting[i].translation);
      }
      CHECK(sum.rotation[axis] == doctest::Approx(by_turn));
      CHECK(sum.translation[axis] == doctest::Approx(by_shift));
    }
    CHECK(body.turning(body.pose(), {1, 0, 0})[k_cube].rotation == glm::dvec3(0));
    CHECK(body.transforms({})[k_cube] == scene.meshes[k_cube].transform);
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("a mesh that stands still hides part of the one that moves") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = three_meshes(96);
    const dpr::Image target = rigid_image(device, scene);
    const dpr::PoseOptions options{.method = near_start(), .meshes = {k_cube}, .solve_translation = true};
    const dpr::PoseSolver solver(device, scene, target, options);
    const dpr::Pose truth = solver.scene_pose();
    const dpr::Pose start = moved(truth, {0.3, -0.3, 0.2}, {0.2, -0.1, 0.3});
    const dpr::PoseResult found = solver.solve(start);
    CHECK(dpr::angle_degrees(found.pose.rotation, truth.rotation) < 0.5);
    CHECK(glm::length(found.pose.translation - truth.translation) < 0.05);
    CHECK(found.explained);

    dpr::Scene alone = scene;
    alone.meshes = {scene.meshes[k_cube]};
    const dpr::PoseResult astray =
        dpr::PoseSolver(device, alone, target, {.method = near_start(), .solve_translation = true})
            .solve(start);
    CHECK(dpr::angle_degrees(astray.pose.rotation, truth.rotation) > 3);
    CHECK_FALSE(astray.explained);

    scene.meshes.erase(scene.meshes.begin() + k_small);
    dpr::Scene without = scene;
    without.meshes.pop_back();
    const dpr::Image nothing = rigid_image(device, without);
    const dpr::PoseResult missing = dpr::PoseSolver(device, scene, nothing, options).solve(start);
    CHECK_FALSE(missing.explained);
  }

  TEST_CASE("meshes that move together keep their places, by least squares and by descent") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = three_meshes(96);
    const dpr::Image target = rigid_image(device, scene);
    dpr::Descent descent;
    descent.restarts = 0;
    const std::vector<std::size_t> both{k_small, k_cube};
    for (const dpr::PoseOptions& options :
         {dpr::PoseOptions{.method = near_start(), .meshes = both, .solve_translation = true},
          dpr::PoseOptions{.method = descent, .meshes = both, .solve_translation = true}}) {
      const bool descends = std::holds_alternative<dpr::Descent>(options.method);
      CAPTURE(descends);
      const dpr::PoseSolver solver(device, scene, target, options);
      const dpr::Pose truth = solver.scene_pose();
      const dpr::PoseResult found = solver.solve(moved(truth, {0.1, -0.15, 0.05}, {0.1, -0.1, 0.1}));
      CHECK(dpr::angle_degrees(found.pose.rotation, truth.rotation) < (descends ? 1 : 0.5));
      CHECK(glm::length(found.pose.translation - truth.translation) < 0.05);
    }
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("a list of moving meshes that names none, or one twice, is refused") {
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = three_meshes(8);
    const dpr::Image target(8, 8);
    const auto refused = [&](const char* says, const dpr::PoseOptions& options) {
      DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::PoseSolver(device, scene, target, options), says);
    };
    refused("number of meshes (pose): got 3, expected 1, or a list", {});
    refused("meshes (pose): got 3, expected numbers of the scene's meshes, below 3",
            {.method = near_start(), .meshes = {3}});
    refused("meshes (pose): got 1 twice", {.method = near_start(), .meshes = {1, 0, 1}});
    dpr::LeastSquares method;
    method.silhouette.image = dpr::Image(8, 8, glm::vec4(1));
    refused("silhouette (pose): got one in a scene where meshes stand still",
            {.method = method, .meshes = {1}});
  }
}

}  // namespace pose_bodies_test
