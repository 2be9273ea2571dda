// Poses of several bodies that hide each other in one picture.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <glm/gtc/matrix_transform.hpp>
#include <set>
#include <utility>
#include <vector>

#include "dpr/light.hpp"
#include "dpr/pose.hpp"
#include "solve/pose_body.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"
#include "support/rigid_image.hpp"

namespace pose_occlusion_test {

namespace {

using dpr::test::is_reduced;
using dpr::test::rigid_image;

struct Placement {
  glm::vec3 place, turn, size;
};

/// A small cube before two larger ones, all of different colours, of which it hides parts.
constexpr std::array<Placement, 3> k_placements{
    {{{0.5F, 0.2F, 1.4F}, {0.3F, 0.5F, 0.1F}, {0.5F, 0.45F, 0.5F}},
     {{-0.5F, 0, -0.6F}, {0.2F, -0.7F, 0.3F}, {0.8F, 0.6F, 0.9F}},
     {{1.2F, 0.4F, -0.2F}, {-0.3F, 0.9F, 0}, {0.6F, 0.7F, 0.5F}}}};

dpr::Scene cubes(std::size_t count, int size) {
  dpr::Scene scene;
  scene.width = scene.height = size;
  scene.camera.view = glm::lookAt(glm::vec3(0, 1, 7), glm::vec3(0), glm::vec3(0, 1, 0));
  scene.camera.fov_y_degrees = 45;
  for (std::size_t i = 0; i < count; ++i) {
    dpr::Mesh mesh = dpr::make_cube();
    mesh.vertex_colors.clear();
    mesh.face_colors.clear();
    for (std::size_t face = 0; face < mesh.faces.size(); ++face) {
      const auto side = static_cast<float>(face / 2);
      glm::vec3 color(0.2F + 0.12F * side, 0.8F - 0.1F * side, 0.2F + 0.2F * std::abs(side - 2));
      for (std::size_t turn = 0; turn < i; ++turn) color = {color.z, color.x, color.y};
      mesh.face_colors.push_back(color);
    }
    const Placement& p = k_placements[i];
    const glm::mat4 rotation(glm::dmat4(dpr::rotation_from_vector(p.turn)));
    scene.meshes.push_back(
        {mesh, glm::translate(glm::mat4(1), p.place) * rotation * glm::scale(glm::mat4(1), p.size)});
  }
  return scene;
}

dpr::PoseBodies each(const dpr::Scene& scene) {
  dpr::PoseBodies bodies;
  for (std::size_t i = 0; i < scene.meshes.size(); ++i) bodies.push_back({i});
  return bodies;
}

/// The scene with its bodies turned and shifted, each another way.
dpr::Scene disturbed(const dpr::Scene& scene, const dpr::PoseBodies& bodies, double turn, double shift) {
  dpr::Scene result = scene;
  double sign = 1;
  for (const auto& meshes : bodies) {
    const dpr::PoseBody body(scene, meshes);
    const glm::dmat3 turned = dpr::rotation_from_vector({sign * turn, -0.7 * turn, 0.4 * sign * turn});
    const glm::dvec3 shifted = shift * glm::dvec3(-0.5 * sign, 0.6, sign);
    body.place(result, {turned * body.pose().rotation, body.pose().translation + shifted});
    sign = -sign;
  }
  return result;
}

dpr::LeastSquares in_light(dpr::PoseLight light, unsigned rotations) {
  dpr::LeastSquares method;
  method.rotations = rotations;
  method.light = light;
  return method;
}

void check_found(const std::vector<dpr::PoseResult>& results, const dpr::Scene& truth,
                 const dpr::PoseBodies& bodies) {
  REQUIRE(results.size() == bodies.size());
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    CAPTURE(i);
    const dpr::Pose pose = dpr::PoseBody(truth, bodies[i]).pose();
    CHECK(dpr::angle_degrees(results[i].pose.rotation, pose.rotation) < 1.5);
    CHECK(glm::length(results[i].pose.translation - pose.translation) < 0.08);
    CHECK(results[i].explained);
    CHECK(results[i].covariance.size() == 36);
  }
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("two bodies that hide each other are found together, but not one with the other astray") {
    const dpr::Device device = dpr::open_device();
    const int size = dpr::test::reduced(72, 12);
    const dpr::Scene truth = cubes(2, size);
    const dpr::PoseBodies bodies = each(truth);
    const dpr::Scene start = disturbed(truth, bodies, 0.25, 0.15);
    const dpr::Image target = rigid_image(device, truth);
    dpr::LeastSquares method = in_light(dpr::PoseLight::fixed, 0);
    if (is_reduced()) method.iterations = 1;
    const dpr::PoseOptions options{.method = method, .solve_translation = true};
    std::set<std::size_t> reported;
    const auto results =
        dpr::solve_bodies(device, start, target, bodies, options, [&](const dpr::PoseIteration& step) {
          reported.insert(step.body);
          return !is_reduced() || step.iteration < 2;
        });
    CHECK(reported == std::set<std::size_t>{0, 1});
    REQUIRE(results.size() == 2);
    for (std::size_t i = 0; i < 2; ++i) {
      CHECK(results[i].history.size() == results[i].iterations);
      CHECK(results[i].history.back().iteration + 1 == results[i].iterations);
      CHECK(results[i].history.back().body == i);
      CHECK(dpr::angle_degrees(results[i].start.rotation, dpr::PoseBody(start, bodies[i]).pose().rotation) <
            1e-3);
    }
    if (is_reduced()) return;
    check_found(results, truth, bodies);

    dpr::PoseOptions one = options;
    one.meshes = {1};
    const dpr::PoseSolver solver(device, start, target, one);
    CHECK_FALSE(solver.solve(solver.scene_pose()).explained);
  }

  TEST_CASE("three bodies, one of two meshes, are found in light that is the same for all") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene truth = cubes(3, 72);
    dpr::Lights lights;
    lights.ambient = glm::vec3(0);
    lights.harmonics.assign(9, glm::vec3(0));
    lights.harmonics[0] = {1.1F, 1, 0.9F};
    lights.harmonics[1] = {0.4F, 0.3F, 0.3F};
    lights.harmonics[2] = {0.3F, 0.3F, 0.35F};
    lights.harmonics[3] = {-0.5F, -0.4F, -0.4F};
    truth.lights = lights;
    const dpr::PoseBodies bodies{{2, 1}, {0}};
    dpr::Scene start = disturbed(truth, bodies, 0.15, 0.1);
    start.lights.reset();
    const dpr::PoseOptions options{.method = in_light(dpr::PoseLight::harmonics, 0),
                                   .solve_translation = true};
    const dpr::Image target = rigid_image(device, truth);
    const auto results = dpr::solve_bodies(device, start, target, bodies, options);
    check_found(results, truth, bodies);
    for (const dpr::PoseResult& result : results) CHECK(result.light == dpr::PoseLight::harmonics);
    // In the mean light of the other bodies more would remain.
    for (const dpr::PoseResult& result : results) CHECK(result.unexplained_part < 0.1);
  }

  TEST_CASE("a search finds three bodies that hide each other, from places that say nothing") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    const dpr::Scene truth = cubes(3, 48);
    const dpr::PoseBodies bodies = each(truth);
    const dpr::Scene start = disturbed(truth, bodies, 2, 0.8);
    dpr::LeastSquares method = in_light(dpr::PoseLight::fixed, 192);
    method.coarsest = 12;
    const dpr::PoseOptions options{.method = method, .solve_translation = true};
    check_found(dpr::search_bodies(device, start, rigid_image(device, truth), bodies, options), truth,
                bodies);
  }

  TEST_CASE("one body in a list is what the solver finds, to the bit") {
    const dpr::Device device = dpr::open_device();
    const int size = dpr::test::reduced(48, 8);
    const dpr::Scene truth = cubes(2, size);
    const dpr::Scene start = disturbed(truth, {{0}}, 0.2, 0.1);
    const dpr::Image target = rigid_image(device, truth);
    dpr::LeastSquares method = in_light(dpr::PoseLight::fixed, 0);
    if (is_reduced()) method.iterations = 1;
    dpr::PoseOptions options{.method = method, .solve_translation = true};
    const auto results = dpr::solve_bodies(device, start, target, {{0}}, options);
    REQUIRE(results.size() == 1);
    options.meshes = {0};
    const dpr::PoseSolver solver(device, start, target, options);
    const dpr::PoseResult single = solver.solve(solver.scene_pose());
    CHECK(results.front().pose.rotation == single.pose.rotation);
    CHECK(results.front().pose.translation == single.pose.translation);
    CHECK(results.front().covariance == single.covariance);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("lists of bodies and options that do not go together are refused") {
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = cubes(3, 8);
    const dpr::Image target(8, 8);
    const dpr::PoseBodies two{{0}, {1}};
    const auto refused = [&](const char* says, const dpr::PoseBodies& bodies,
                             const dpr::PoseOptions& options = {}) {
      DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::solve_bodies(device, scene, target, bodies, options),
                            says);
      DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::search_bodies(device, scene, target, bodies, options),
                            says);
    };
    refused("bodies (pose): got 0", {});
    refused("meshes of a body (pose): got 0", {{0}, {}});
    refused("meshes (pose): got 1 twice, expected each in one body", {{0, 1}, {1}});
    refused("meshes (pose): got 3, expected numbers of the scene's meshes", {{0}, {3}});
    refused("meshes (pose): got 1, expected none beside a list of bodies", two,
            {.method = dpr::LeastSquares{}, .meshes = {2}});
    refused("method (pose): got a descent beside several bodies", two, {.method = dpr::Descent{}});
    refused("focal (pose): got one beside several bodies", two,
            {.method = dpr::LeastSquares{}, .solve_focal = true});
    refused("distortion (pose): got one beside several bodies", two,
            {.method = dpr::LeastSquares{}, .solve_distortion = true});
    dpr::LeastSquares method;
    method.box = dpr::PoseBox{1, 1, 4, 4};
    refused("box (pose): got one beside several bodies", two, {.method = method});
    method.box.reset();
    method.silhouette.image = dpr::Image(8, 8, glm::vec4(1));
    refused("silhouette (pose): got one beside several bodies", two, {.method = method});
    DPR_CHECK_MESSAGE_HAS(
        dpr::InvalidArgument,
        dpr::search_bodies(device, scene, target, two, {.method = in_light(dpr::PoseLight::fixed, 0)}),
        "rotations (pose search): got 0");
  }
}

}  // namespace pose_occlusion_test
