// Poses from silhouettes and depths, alone and beside colours that tell little; and what the solver refuses of them.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>

#include "dpr/aov.hpp"
#include "dpr/error.hpp"
#include "dpr/mesh.hpp"
#include "dpr/pose.hpp"
#include "dpr/renderer.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

namespace pose_observations_test {

using namespace dpr;

namespace {

/// A white body that looks different after any turn, in a light from one side.
Scene body_scene() {
  Scene scene;
  scene.width = test::reduced(80, 10);
  scene.height = test::reduced(72, 8);
  scene.camera.view[3] = glm::vec4(0.1F, -0.1F, -4, 1);
  scene.camera.znear = 1;
  scene.camera.zfar = 20;
  Mesh body;  // a prism over an L whose arms differ
  const glm::vec2 outline[] = {{0, 0}, {2, 0}, {2, 0.6F}, {0.7F, 0.6F}, {0.7F, 1.4F}, {0, 1.4F}};
  for (const float z : {-0.45F, 0.45F}) {
    for (const glm::vec2& p : outline) body.positions.emplace_back(p - glm::vec2(1, 0.7F), z);
  }
  for (unsigned i = 0; i < 6; ++i) {
    const unsigned next = (i + 1) % 6;
    body.faces.insert(body.faces.end(), {{i, next, next + 6}, {i, next + 6, i + 6}});
    if (i == 0 || i == 5) continue;
    body.faces.insert(body.faces.end(), {{0, next, i}, {6, i + 6, next + 6}});
  }
  scene.meshes.push_back({body, glm::mat4(1)});
  scene.smoothing = smoothing_preset("rigid");
  scene.lights.emplace();
  scene.lights->ambient = {0.2F, 0.2F, 0.2F};
  scene.lights->directional.push_back(
      {.direction = {1, -1, -1}, .diffuse = {0.7F, 0.7F, 0.7F}, .specular = {}});
  return scene;
}

const Pose k_truth{rotation_from_vector({0.3, -0.5, 0.2}), {0.15, -0.1, 0.2}};

Pose moved(double degrees, const glm::dvec3& shift) {
  const glm::dvec3 axis = glm::normalize(glm::dvec3(1, 2, -1));
  return {rotation_from_vector(glm::radians(degrees) * axis) * k_truth.rotation, k_truth.translation + shift};
}

/// What is seen of the body in the true pose.
struct Seen {
  explicit Seen(const Device& device, Scene scene = body_scene()) {
    scene.meshes[0].transform = glm::mat4(glm::mat3(k_truth.rotation));
    scene.meshes[0].transform[3] = glm::vec4(glm::vec3(k_truth.translation), 1);
    Renderer renderer(device);
    renderer.set_scene(scene);
    renderer.forward();
    colors = silhouette = depth = renderer.image();
    const AuxiliaryOutputs outputs = auxiliary_outputs(renderer);
    for (std::size_t i = 0; i < colors.pixels.size(); ++i) {
      silhouette.pixels[i] = glm::vec4(colors.pixels[i].w);
      depth.pixels[i] = glm::vec4(glm::vec3(outputs.depth[i]), 1);
    }
  }

  Image colors, silhouette, depth;
};

LeastSquares near_start() {
  LeastSquares method;
  method.rotations = 0;
  method.light = PoseLight::fixed;
  if (test::is_reduced()) method.iterations = 1, method.coarsest = 8;
  return method;
}

PoseResult find(const Device& device, const Scene& scene, const Image& target, const LeastSquares& method,
                const Pose& start) {
  return PoseSolver(device, scene, target, {.method = method, .solve_translation = true}).solve(start);
}

void check_near(const PoseResult& result, double degrees, double distance) {
  if (test::is_reduced()) return;
  CHECK(angle_degrees(result.pose.rotation, k_truth.rotation) < degrees);
  CHECK(glm::distance(result.pose.translation, k_truth.translation) < distance);
  CHECK(result.covariance.size() == 36);
}

void check_found(const PoseResult& result, double degrees, double distance) {
  check_near(result, degrees, distance);
  CHECK((result.explained || test::is_reduced()));
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("a pose from a silhouette alone") {
    const Device device = open_device();
    const Seen seen(device);
    LeastSquares method = near_start();
    method.silhouette.image = seen.silhouette;
    check_found(find(device, body_scene(), {}, method, moved(8, {0.1, 0.05, 0})), 2, 0.05);
  }

  TEST_CASE("a pose from depths: of the object alone, from anywhere; of a scene, with a silhouette") {
    const Device device = open_device();
    Seen seen(device);
    LeastSquares method = near_start();
    if (!test::is_reduced()) method.rotations = 288;
    method.depth.image = seen.depth;
    check_near(find(device, body_scene(), {}, method, moved(120, {0.2, 0, 0.3})), 0.5, 0.01);
    method = near_start();
    for (std::size_t i = 0; i < seen.depth.pixels.size(); ++i) {
      float& depth = seen.depth.pixels[i].x;
      if (depth == 0) depth = 7 + 0.001F * static_cast<float>(i % 64);  // a wall
      if (i % 5 == 0) depth = std::numeric_limits<float>::quiet_NaN();
      if (i % 11 == 0) depth = 3;  // a sensor's errors
    }
    method.depth.image = seen.depth;
    method.silhouette.image = seen.silhouette;
    check_near(find(device, body_scene(), {}, method, moved(12, {0.05, 0.05, 0.1})), 1, 0.03);
  }

  TEST_CASE("search: depths of an object tell how far away it is, and not those of more") {
    if (test::is_reduced()) return;
    const Device device = open_device();
    Seen seen(device);
    LeastSquares method;
    method.rotations = 288;
    const auto search = [&](float nearer) {
      Scene scene = body_scene();
      scene.meshes[0].transform[3] = glm::vec4(0.5F, 0.2F, nearer, 1);
      method.depth.image = seen.depth;
      return PoseSolver(device, scene, {}, {.method = method, .solve_translation = true}).search();
    };
    for (const float nearer : {1.2F, -3.0F, -8.0F}) {  // from a distance of 4
      CAPTURE(nearer);
      check_found(search(nearer), 1, 0.02);
    }
    const Image whole = seen.depth;
    std::mt19937 random(3);
    for (glm::vec4& p : seen.depth.pixels)
      if (random() % 5 < 2) p.x = 0;  // holes
    check_found(search(-3), 2, 0.05);
    seen.depth = whole;
    for (glm::vec4& p : seen.depth.pixels)
      if (p.x == 0) p.x = 7;  // a wall
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, search(0), "depth (pose): got depths of more than the object");
  }

  TEST_CASE("depths alone explain an object in pictures of any size, and no other") {
    const Device device = open_device();
    for (const int size : {64, 96, 128, 192}) {
      CAPTURE(size);
      Scene scene = body_scene();
      scene.width = scene.height = test::reduced(size, 8);
      LeastSquares method = near_start();
      method.depth.image = Seen(device, scene).depth;
      check_found(find(device, scene, {}, method, moved(6, {0.05, 0, 0.1})), 48.0 / size, 1.0 / size);
      Scene other = scene;
      other.meshes[0].mesh = make_icosphere(2);
      const PoseResult wrong = find(device, other, {}, method, k_truth);
      Scene turned = scene;  // its mirror image
      for (glm::vec3& p : turned.meshes[0].mesh.positions) p.x = -p.x;
      for (glm::uvec3& face : turned.meshes[0].mesh.faces) std::swap(face.x, face.y);
      const PoseResult mirrored = find(device, turned, {}, method, k_truth);
      if (test::is_reduced()) return;
      CHECK_FALSE(wrong.explained);
      CHECK_FALSE(mirrored.explained);
    }
  }

  TEST_CASE("depths of a cube are explained by each of its 24 poses") {
    if (test::is_reduced()) return;
    const Device device = open_device();
    Scene scene = body_scene();
    scene.meshes[0].mesh = make_cube();
    LeastSquares method;
    method.depth.image = Seen(device, scene).depth;
    const PoseResult result = find(device, scene, {}, method, moved(10, {0.05, 0, 0.1}));
    CHECK(result.explained);
    CHECK(result.equals.size() == 24);
    CHECK(angle_degrees(result.pose.rotation, k_truth.rotation) < 1);
    for (const PoseHypothesis& equal : result.equals) {
      const glm::dmat3 turn = glm::transpose(result.pose.rotation) * equal.pose.rotation;
      for (int axis = 0; axis < 3; ++axis) {  // onto another, to within two degrees
        const glm::dvec3 turned = glm::abs(turn[axis]);
        CHECK(std::max({turned.x, turned.y, turned.z}) > std::cos(glm::radians(2.0)));
      }
    }
  }

  TEST_CASE("silhouette and depths rescue a pose from a picture in a light that is wrong") {
    const Device device = open_device();
    const Seen seen(device);
    Scene scene = body_scene();
    scene.lights->directional[0].direction = {-1, 1, -0.5F};
    LeastSquares method = near_start();
    const Pose start = moved(12, {0.1, 0.05, 0});
    const PoseResult without = find(device, scene, seen.colors, method, start);
    method.silhouette.image = seen.silhouette;
    method.depth.image = seen.depth;
    const PoseResult with = find(device, scene, seen.colors, method, start);
    if (test::is_reduced()) return;
    CHECK_FALSE(without.explained);
    CHECK(angle_degrees(without.pose.rotation, k_truth.rotation) > 5);
    CHECK(angle_degrees(with.pose.rotation, k_truth.rotation) < 1);
    CHECK(glm::distance(with.pose.translation, k_truth.translation) < 0.02);
  }

  TEST_CASE(
      "weights: an observation with the weight 0 changes no pose, one beside colours leaves them right") {
    const Device device = open_device();
    const Seen seen(device);
    LeastSquares method = near_start();
    const Pose start = moved(12, {0.1, 0.05, 0});
    const PoseResult colors = find(device, body_scene(), seen.colors, method, start);
    check_found(colors, 1, 0.03);
    method.depth.image = seen.depth;
    check_found(find(device, body_scene(), seen.colors, method, start), 1, 0.03);
    method.depth.weight = 0;
    check_found(find(device, body_scene(), seen.colors, method, start), 1, 0.03);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("silhouettes and depths that say nothing are refused by name") {
    const Device device = open_device();
    const Scene scene = body_scene();
    const Image black(scene.width, scene.height), none;
    const auto solver = [&](const Image& silhouette, const Image& depth) {
      LeastSquares method;
      method.silhouette.image = silhouette;
      method.depth.image = depth;
      return PoseSolver(device, scene, {}, {.method = method});
    };
    const auto filled = [&](float value) { return Image(scene.width, scene.height, glm::vec4(value)); };
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, solver(none, none), "size of the target (pose): got 0x0");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, solver(Image(3, 2), none),
                          "size of the silhouette (pose): got 3x2");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, solver(black, none), "sum of the silhouette (pose)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, solver(filled(2), none), "a coverage in [0, 1]");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, solver(none, Image(3, 2)), "size of the depth (pose): got 3x2");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, solver(none, black), "depth (pose): got no pixel that has one");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, solver(none, filled(5000)),
                          "expected some from znear to zfar, 1 to 20");
    Image behind = filled(5);
    behind.pixels[1].x = -1;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, solver(none, behind), "depth (pose): got -1");
    LeastSquares method;
    method.depth = {filled(5), -1};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, PoseSolver(device, scene, {}, {.method = method}),
                          "depth_weight (pose): got -1");
    Image nothing = filled(std::numeric_limits<float>::quiet_NaN());
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, solver(none, nothing), "0 or NaN where there is none");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, PoseSolver(device, scene, {}, {.method = Descent{}}),
                          "size of the target (pose)");
  }
}

}  // namespace pose_observations_test
