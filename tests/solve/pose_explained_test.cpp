// When a pose counts as explaining its target.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/gtc/matrix_transform.hpp>
#include <random>
#include <string>

#include "dpr/dpr.hpp"
#include "support/data.hpp"
#include "support/reduced.hpp"
#include "support/rigid_image.hpp"

namespace pose_explained_test {

namespace {

using dpr::test::rigid_image;

/// Half a turn about an axis gives nearly the same picture: opposite faces differ a little.
dpr::Scene nearly_symmetric(int size) {
  dpr::Scene scene;
  scene.width = scene.height = size;
  scene.camera = dpr::orbit_camera(6.7F, 30, 120);
  scene.meshes.push_back({dpr::make_cube(), glm::scale(glm::mat4(1.0F), glm::vec3(0.7F, 1, 1.3F))});
  dpr::Mesh& mesh = scene.meshes.front().mesh;
  mesh.vertex_colors.clear();
  mesh.face_colors.clear();
  for (const glm::uvec3& face : mesh.faces) {
    const glm::vec3 sum = mesh.positions[face.x] + mesh.positions[face.y] + mesh.positions[face.z];
    glm::vec3 color(0.3F);
    for (int axis = 0; axis < 3; ++axis) {
      if (std::abs(sum[axis]) > 2.9F) color[axis] = sum[axis] > 0 ? 0.9F : 0.7F;
    }
    mesh.face_colors.push_back(color);
  }
  return scene;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("a search explains a target by one pose, and not by either of two") {
    if (dpr::test::is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    dpr::Scene scene = nearly_symmetric(64);
    const dpr::Image one = rigid_image(device, scene);
    dpr::Scene turned = scene;
    turned.meshes.front().transform *= glm::mat4(glm::mat3({-1, 0, 0}, {0, 1, 0}, {0, 0, -1}));
    const dpr::Image other = rigid_image(device, turned);
    dpr::LeastSquares method;
    method.light = dpr::PoseLight::fixed;
    for (const float share : {0.525F, 0.9F}) {
      CAPTURE(share);
      dpr::Image target = one;
      for (std::size_t i = 0; i < target.pixels.size(); ++i)
        target.pixels[i] = glm::mix(other.pixels[i], one.pixels[i], share);
      const dpr::PoseResult result = dpr::PoseSolver(device, scene, target, {.method = method}).search();
      CHECK(dpr::angle_degrees(result.pose.rotation, glm::dmat3(1.0)) < 2);
      CHECK(result.explained == (share > 0.6F));
    }
  }

  TEST_CASE("a robust loss explains an object's picture, and not that of another") {
    if (dpr::test::is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    const auto folder = dpr::test::data_folder() / "foreign";
    const dpr::Scene scene = dpr::read_scene(folder / "spot.json");
    for (const char* const picture : {"spot01.exr", "fish00.exr"}) {
      CAPTURE(picture);
      dpr::LeastSquares method;
      method.robust = true;
      const dpr::Image target = dpr::read_image(folder / picture);
      const dpr::PoseResult result = dpr::PoseSolver(device, scene, target, {.method = method}).search();
      CHECK(result.explained == (std::string(picture) == "spot01.exr"));
    }
  }

  TEST_CASE("noise is no reason to doubt a pose, nor to take one for right") {
    if (dpr::test::is_reduced()) return;
    const dpr::Device device = dpr::open_device();
    const auto folder = dpr::test::data_folder() / "foreign";
    const dpr::Scene scene = dpr::read_scene(folder / "spot.json");
    for (const std::string picture : {"spot01.exr", "fish00.exr", "no object"}) {
      CAPTURE(picture);
      const bool is_empty = picture == "no object";
      dpr::Image target =
          is_empty ? dpr::Image(scene.width, scene.height) : dpr::read_image(folder / picture);
      std::mt19937 random(5);
      std::normal_distribution<float> noise(0, 0.05F);
      for (glm::vec4& p : target.pixels)
        for (int channel = 0; channel < 3; ++channel) p[channel] = std::max(p[channel] + noise(random), 0.0F);
      const dpr::PoseResult result =
          dpr::PoseSolver(device, scene, target, {.method = dpr::LeastSquares{}}).search();
      CHECK(result.explained == (picture == "spot01.exr"));
      CHECK(result.unexplained_part >= 0);
      if (!result.explained) CHECK(result.unexplained_part > 0.3);
    }
  }
}

}  // namespace pose_explained_test
