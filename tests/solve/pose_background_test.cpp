// Poses before a background that nothing is known of.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <random>
#include <vector>

#include "dpr/pose_tracker.hpp"
#include "solve/extent.hpp"
#include "solve/pose_level.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"
#include "support/rigid_image.hpp"

namespace pose_background_test {

namespace {

using dpr::test::is_reduced;

dpr::Scene cube_scene() {
  dpr::Scene scene;
  scene.width = dpr::test::reduced(80, 12);
  scene.height = dpr::test::reduced(72, 12);
  scene.camera.view = glm::lookAt(glm::vec3(0, 1, 6), glm::vec3(0), glm::vec3(0, 1, 0));
  scene.camera.fov_y_degrees = 45;
  dpr::Mesh mesh = dpr::make_cube();
  mesh.vertex_colors.clear();
  mesh.face_colors.clear();
  for (std::size_t face = 0; face < mesh.faces.size(); ++face) {
    const auto side = static_cast<float>(face / 2);
    mesh.face_colors.emplace_back(0.1F + 0.16F * side, 0.9F - 0.15F * side,
                                  0.1F + 0.25F * std::abs(side - 2));
  }
  scene.meshes.push_back({mesh, glm::mat4(1)});
  return scene;
}

dpr::Scene placed(dpr::Scene scene, const dpr::Pose& pose) {
  glm::mat4& transform = scene.meshes[0].transform;
  transform = glm::mat4(glm::mat3(pose.rotation));
  transform[3] = glm::vec4(glm::vec3(pose.translation), 1);
  return scene;
}

/// Squares of any colours, some as dark as the scene's background.
dpr::Image room(const dpr::Scene& scene) {
  constexpr int k_side = 6;
  std::mt19937 engine(5);
  std::uniform_real_distribution<float> number(0, 1);
  const int columns = scene.width / k_side + 1;
  std::vector<glm::vec3> colors;
  for (int i = 0; i < columns * (scene.height / k_side + 1); ++i) {
    const float brightness = number(engine);
    colors.push_back(brightness * brightness * glm::vec3(number(engine), number(engine), number(engine)));
  }
  dpr::Image image(scene.width, scene.height);
  for (int y = 0; y < scene.height; ++y) {
    for (int x = 0; x < scene.width; ++x) {
      const glm::vec3& color = colors[static_cast<std::size_t>(y / k_side * columns + x / k_side)];
      image.pixels[static_cast<std::size_t>(y * scene.width + x)] = glm::vec4(color, 1);
    }
  }
  return image;
}

dpr::Image photograph(const dpr::Device& device, const dpr::Scene& scene, const dpr::Pose& pose) {
  const dpr::Image object = dpr::test::rigid_image(device, placed(scene, pose));
  dpr::Image image = room(scene);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const float alpha = object.pixels[i].w;
    image.pixels[i] = glm::vec4(glm::mix(glm::vec3(image.pixels[i]), glm::vec3(object.pixels[i]), alpha), 1);
  }
  return image;
}

dpr::LeastSquares before_anything(dpr::PoseLight light) {
  dpr::LeastSquares method;
  method.rotations = dpr::test::reduced(288U, 4U);
  method.light = light;
  method.robust = true;
  method.unknown_background = true;
  if (is_reduced()) method.iterations = 1, method.coarsest = 12;
  return method;
}

const dpr::Pose k_truth{dpr::rotation_from_vector({0.3, 0.6, 0.1}), {0.2, -0.1, 0.3}};

/// So far from the truth.
dpr::Pose moved(double radians, const glm::dvec3& shift) {
  const glm::dvec3 turn = radians * glm::normalize(glm::dvec3(1, -1, 0.5));
  return {dpr::rotation_from_vector(turn) * k_truth.rotation, k_truth.translation + shift};
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("a pose before a background that is not the scene's") {
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = cube_scene();
    for (const dpr::PoseLight light : {dpr::PoseLight::fixed, dpr::PoseLight::gain}) {
      CAPTURE(static_cast<int>(light));
      dpr::Scene lit = scene;
      if (light == dpr::PoseLight::gain)
        for (glm::vec3& color : lit.meshes[0].mesh.face_colors) color *= glm::vec3(0.6F, 0.8F, 1);
      const dpr::Image target = photograph(device, lit, k_truth);
      const dpr::PoseOptions options{.method = before_anything(light), .solve_translation = true};
      const dpr::Pose start = moved(0.4, {0.1, 0.15, -0.3});
      const dpr::PoseResult found = dpr::PoseSolver(device, scene, target, options).solve(start);
      if (is_reduced()) continue;
      CHECK(dpr::angle_degrees(found.pose.rotation, k_truth.rotation) < 1);
      CHECK(glm::distance(found.pose.translation, k_truth.translation) < 0.05);
      CHECK(found.light == light);
      CHECK(found.explained);
      CHECK(found.unexplained_part < 0.2);
      CHECK(found.covariance.size() == 36);
      // The room alone does not show it.
      const dpr::PoseResult absent = dpr::PoseSolver(device, scene, room(scene), options).solve(start);
      CHECK_FALSE(absent.explained);
      CHECK(absent.unexplained_part > 0.4);
    }
  }

  TEST_CASE(
      "an object of one colour in a light of its own ends at its outline, where its box has other colours") {
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = cube_scene();
    dpr::Mesh& mesh = scene.meshes[0].mesh;
    for (glm::vec3& p : mesh.positions) p *= glm::vec3(1, 0.7F, 0.45F);
    mesh.face_colors.assign(mesh.faces.size(), glm::vec3(1));
    dpr::Scene lit = scene;
    dpr::Lights lights;
    lights.ambient = {0.3F, 0.15F, 0.02F};
    dpr::DirectionalLight& sun = lights.directional.emplace_back();
    sun.direction = glm::normalize(glm::vec3(-1, -1.2F, -1));
    sun.diffuse = {0.5F, 0.25F, 0.03F};
    lit.lights = lights;
    const dpr::Image target = photograph(device, lit, k_truth);
    dpr::LeastSquares method = before_anything(dpr::PoseLight::harmonics);
    method.rotations = 0;
    dpr::Image coverage = dpr::test::rigid_image(device, placed(lit, k_truth));
    for (glm::vec4& pixel : coverage.pixels) pixel.x = pixel.w;
    method.box = dpr::extent(coverage);
    const dpr::PoseOptions options{.method = method, .solve_translation = true};
    const dpr::Pose start = moved(0.1, {0, 0.05, 0.4});
    const dpr::PoseResult found = dpr::PoseSolver(device, scene, target, options).solve(start);
    if (is_reduced()) return;
    CHECK(dpr::angle_degrees(found.pose.rotation, k_truth.rotation) < 2);
    CHECK(glm::distance(found.pose.translation, k_truth.translation) < 0.06);
    CHECK(found.explained);
  }

  TEST_CASE(
      "an object before its own colour belongs in its box, and is not explained where it fills the picture") {
    if (is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = cube_scene();
    scene.camera.view = glm::translate(glm::mat4(1), glm::vec3(0, 0, -6));
    const dpr::Pose far{glm::dmat3(1), glm::dvec3(0)}, near{glm::dmat3(1), {0, 0, 3.5}};
    const dpr::Image target = dpr::test::rigid_image(device, placed(scene, near));  // one side alone
    dpr::LeastSquares method = before_anything(dpr::PoseLight::fixed);
    method.rotations = 0;
    const dpr::PoseOptions options{.method = method, .solve_translation = true};
    const dpr::PoseResult filling = dpr::PoseSolver(device, scene, target, options).solve(near);
    CHECK(filling.unexplained_part < 0.05);
    CHECK_FALSE(filling.explained);
    CHECK(filling.doubt == dpr::PoseDoubt::empty_picture);
    const dpr::PoseResult outside =
        dpr::PoseSolver(device, scene, target, options).solve({far.rotation, {20, 0, 0}});
    CHECK(outside.unexplained_part == 1);
    CHECK_FALSE(outside.explained);

    const dpr::PoseSpace space(scene, far, options);
    const std::array<dpr::Hypothesis, 2> hypotheses{{{far}, {{far.rotation, {0, 0, 1.5}}}}};
    const auto losses = [&] {
      dpr::PoseLevel level(device, {scene, target, method}, space, {scene.height, method.blur},
                           dpr::PoseLight::fixed, dpr::CornerNormals::parted);
      level.set_color_scale(0.2F);
      return level.losses(hypotheses);
    };
    const std::vector<double> anywhere = losses();
    CHECK(anywhere[1] < 0.8 * anywhere[0]);
    method.box = dpr::PoseBox{22.6F, 18.6F, 34.8F, 34.8F};  // the side from afar
    const std::vector<double> boxed = losses();
    CHECK(boxed[0] < 0.2 * anywhere[0]);
    CHECK(boxed[1] > 3 * boxed[0]);
  }

  TEST_CASE("an object is tracked before a background that is not the scene's") {
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = cube_scene();
    dpr::TrackOptions options{.solve_translation = true};
    options.method = before_anything(dpr::PoseLight::fixed);
    options.method.noise = dpr::Noise::pixel;
    dpr::PoseTracker tracker(device, placed(scene, moved(0.02, {0.01, 0, 0})), options);
    for (int frame = 0; frame < dpr::test::reduced(4, 2); ++frame) {
      CAPTURE(frame);
      const dpr::Pose pose = moved(0.05 * frame, glm::dvec3(0.04, -0.02, 0.03) * static_cast<double>(frame));
      const dpr::TrackedPose tracked = tracker.track(photograph(device, scene, pose));
      if (is_reduced()) continue;
      CHECK(tracked.status == (frame == 0 ? dpr::TrackStatus::found : dpr::TrackStatus::tracked));
      CHECK(tracked.loss < tracked.explained_below);
      CHECK(dpr::angle_degrees(tracked.pose.rotation, pose.rotation) < 1);
      CHECK(glm::distance(tracked.pose.translation, pose.translation) < 0.05);
    }
    if (is_reduced()) return;
    const dpr::TrackedPose missed = tracker.track(room(scene));
    CHECK(missed.status == dpr::TrackStatus::lost);
    CHECK(missed.loss > missed.explained_below);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("a background is unknown to a robust loss of colours alone") {
    const dpr::Device device = dpr::open_device();
    const dpr::Scene scene = cube_scene();
    const dpr::Image target = room(scene);
    const auto solver = [&](const dpr::Image& image, const dpr::LeastSquares& method) {
      return dpr::PoseSolver(device, scene, image, {.method = method});
    };
    dpr::LeastSquares method = before_anything(dpr::PoseLight::fixed);
    method.robust = false;
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, solver(target, method),
                          "unknown_background (pose): got a loss that is not robust");
    method.robust = true;
    method.silhouette.image = dpr::Image(scene.width, scene.height, glm::vec4(1));
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, solver(target, method), "a silhouette, which tells");
    method.depth.image = method.silhouette.image;
    for (glm::vec4& depth : method.depth.image.pixels) depth.x = 6;
    method.silhouette.image = {};
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, solver({}, method), "size of the target (pose): got 0x0");
  }
}

}  // namespace pose_background_test
