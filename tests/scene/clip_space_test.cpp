// Positions in clip space: images and gradients are those of the camera that made them.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "dpr/dpr.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

namespace clip_space_test {

using namespace dpr;
using dpr::test::reduced;

namespace {

struct Rendered {
  Image image;
  std::vector<glm::vec3> gradient;
};

Rendered rendered(std::vector<glm::vec3> positions, const Camera& camera, const Mesh& mesh, int width,
                  int height) {
  Scene scene;
  scene.width = width;
  scene.height = height;
  scene.camera = camera;
  scene.smoothing.noise = Noise::pixel;
  scene.smoothing.sigma = 1e-3F;
  scene.meshes.push_back({.mesh = mesh});
  scene.meshes[0].mesh.positions = std::move(positions);
  scene.gradients.positions = true;
  Renderer renderer(open_device());
  renderer.set_scene(scene);
  renderer.forward();
  Image grad(width, height);
  for (std::size_t i = 0; i < grad.pixels.size(); ++i) {
    const auto k = static_cast<float>(i);
    grad.pixels[i] = {std::sin(k), std::cos(2 * k), std::sin(3 * k), 0.5F};
  }
  Image image = renderer.image();
  return {std::move(image), renderer.backward({&grad, 1}).meshes[0].positions};
}

Mesh colored_sphere() {
  Mesh mesh = make_icosphere(1);
  mesh.face_colors.clear();
  mesh.vertex_colors.clear();
  for (const glm::vec3& p : mesh.positions) mesh.vertex_colors.push_back(0.5F + 0.4F * p);
  return mesh;
}

std::vector<glm::vec4> clipped(const Mesh& mesh, const glm::mat4& matrix) {
  std::vector<glm::vec4> positions;
  for (const glm::vec3& p : mesh.positions) positions.emplace_back(matrix * glm::vec4(p, 1));
  return positions;
}

/// Of a camera, directly and by way of its clip space.
void check(const Camera& camera, bool is_perspective) {
  const int width = reduced(40, 14), height = reduced(30, 10);
  const Mesh mesh = colored_sphere();
  const Rendered expected = rendered(mesh.positions, camera, mesh, width, height);
  const glm::mat4 matrix = glm::mat4(to_opengl_projection(camera, width, height)) * glm::mat4(camera.view);
  const std::vector<glm::vec4> positions = clipped(mesh, matrix);
  const ClipSpace space(positions, 1, mesh.faces, width, height);
  REQUIRE(space.is_perspective() == is_perspective);
  const Rendered found = rendered(space.vertices(positions), space.camera(), mesh, width, height);
  double difference = 0;
  for (std::size_t i = 0; i < found.image.pixels.size(); ++i) {
    const glm::vec4 d = found.image.pixels[i] - expected.image.pixels[i];
    for (int k = 0; k < 4; ++k) difference = std::max(difference, std::abs(double{d[k]}));
  }
  CHECK(difference < 1e-4);
  const std::vector<glm::vec4> gradient = space.gradient(positions, found.gradient);
  double largest = 0, error = 0;
  for (std::size_t i = 0; i < gradient.size(); ++i) {
    const glm::vec3 of_world(glm::transpose(matrix) * gradient[i]);
    for (int k = 0; k < 3; ++k) {
      error = std::max(error, std::abs(double{of_world[k]} - double{expected.gradient[i][k]}));
      largest = std::max(largest, std::abs(double{expected.gradient[i][k]}));
    }
  }
  CHECK(largest > 0.1);
  CHECK(error < 1e-3 * largest);
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("clip space: what a pinhole or an orthographic camera projects is shown as it shows it") {
    Camera camera = orbit_camera(3, 25, 40);
    camera.znear = 0.5F;
    camera.zfar = 8;
    check(camera, true);
    camera.orthographic_height = 2.8F;
    check(camera, false);
  }
}

TEST_SUITE("unit") {
  TEST_CASE("clip space: the camera follows what z and w say") {
    const Mesh mesh = colored_sphere();
    Camera camera = orbit_camera(3, 25, 40);
    camera.znear = 0.5F;
    const glm::mat4 matrix = glm::mat4(to_opengl_projection(camera, 20, 10)) * glm::mat4(camera.view);
    std::vector<glm::vec4> positions = clipped(mesh, matrix);
    const auto by_w = [&](auto change) {
      std::vector<glm::vec4> all = positions;
      for (glm::vec4& p : all) change(p);
      return all;
    };
    // The plane z = -w stays where it was, in units of the nearest vertex.
    const ClipSpace whole(positions, 1, {}, 20, 10);
    CHECK(whole.camera().znear == doctest::Approx(0.999));
    // Two shapes, one at twice the distance: a factor for each.
    std::vector<glm::vec4> two = positions;
    for (const glm::vec4& p : positions) two.push_back(2.0F * p);
    const ClipSpace of_two(two, 2, mesh.faces, 20, 10);
    CHECK(of_two.scales()[0] == doctest::Approx(2 * double{of_two.scales()[1]}));
    // Around the eye: cut at OpenGL's near plane.
    const std::vector<glm::vec4> around = clipped(mesh, glm::mat4(to_opengl_projection(camera, 20, 10)));
    const ClipSpace inside(around, 1, mesh.faces, 20, 10);
    REQUIRE(inside.is_perspective());
    CHECK(inside.camera().znear == 1.0F);
    CHECK(1 / double{inside.scales()[0]} == doctest::Approx(0.5).epsilon(1e-4));
    // No function of w: by z / w, in front of the camera alone.
    const auto bent = by_w([](glm::vec4& p) { p.z = 0.1F * p.x * p.x; });
    CHECK_FALSE(ClipSpace(bent, 1, {}, 20, 10).is_perspective());
    auto behind = bent;
    behind[3].w = -1;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, ClipSpace(behind, 1, {}, 20, 10), "behind the camera");
    behind = bent;
    behind.push_back({0, 0, 0, -1});  // no face has it
    CHECK_FALSE(ClipSpace(behind, 1, mesh.faces, 20, 10).is_perspective());
  }

  TEST_CASE("clip space refuses what it cannot use") {
    std::vector<glm::vec4> positions(3, glm::vec4(0, 0, 0, 1));
    const std::vector<glm::uvec3> faces{{0, 1, 3}};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, ClipSpace(positions, 2, {}, 8, 8), "positions (ClipSpace)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, ClipSpace({}, 1, {}, 8, 8), "positions (ClipSpace)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, ClipSpace(positions, 1, faces, 8, 8), "faces (ClipSpace): got 3");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, ClipSpace(positions, 1, {}, 0, 8), "size (ClipSpace)");
    const ClipSpace space(positions, 1, {}, 8, 8);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, space.gradient(positions, {}), "grad_vertices");
    positions[1].y = std::numeric_limits<float>::quiet_NaN();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, ClipSpace(positions, 1, {}, 8, 8), "positions[1]");
  }
}

}  // namespace clip_space_test
