// The scenes that the tests of the whole pipeline share, beside those of the self-test.
#pragma once

#include <string_view>
#include <utility>
#include <vector>

#include "check/scenes.hpp"
#include "dpr/renderer.hpp"
#include "support/priors.hpp"

namespace dpr::test::pipeline {

using namespace check;

/// A scene's image by a renderer of its own.
inline Image rendered(const Scene& scene) {
  Renderer renderer(open_device());
  renderer.set_scene(scene);
  renderer.forward();
  return renderer.image();
}

/// True for the name of a gradient by the smoothing.
inline bool is_sensitivity(std::string_view block) {
  return block == "sigma" || block == "gamma" || block == "alpha";
}

/// From within: faces at the camera's sides reach behind it.
inline Scene scene_within(Mesh mesh, int width, int height) {
  return scene_from_near(std::move(mesh), width, height,
                         orbit_camera(0.55F, 21.0F, 37.0F, {0.1F, -0.07F, 0.05F}), 0.2F);
}

/// A plane below the camera, from behind it to the horizon, of quads with a row of corners in the camera's
/// plane.
inline Scene floor_scene(int width, int height) {
  Random random(19);
  Mesh mesh;
  for (const float z : {6.0F, 0.0F, -9.0F}) {
    for (const float x : {-7.0F, 0.4F, 8.0F}) {
      mesh.positions.emplace_back(x, -0.9F, z);
      mesh.vertex_colors.push_back(random.vector(0.0F, 1.0F));
    }
  }
  for (const unsigned corner : {0U, 1U, 3U, 4U}) {
    mesh.faces.emplace_back(corner, corner + 1, corner + 4);
    mesh.faces.emplace_back(corner, corner + 4, corner + 3);
  }
  Scene scene = scene_of(std::move(mesh), width, height);
  scene.meshes[0].transform = glm::mat4(1.0F);
  scene.camera = Camera{};
  scene.camera.fov_y_degrees = 70.0F;
  scene.camera.znear = 0.3F;
  scene.camera.zfar = 20.0F;
  return scene;
}

/// Triangles all over the place, each with its own vertices.
inline Mesh random_soup(unsigned faces, unsigned seed) {
  Random random(seed);
  Mesh mesh;
  for (unsigned f = 0; f < faces; ++f) {
    const glm::vec3 middle = random.vector(-1.2F, 1.2F);
    for (unsigned i = 0; i < 3; ++i) {
      mesh.positions.push_back(middle + random.vector(-0.6F, 0.6F));
      mesh.vertex_colors.push_back(random.vector(0.0F, 1.0F));
    }
    mesh.faces.emplace_back(3 * f, 3 * f + 1, 3 * f + 2);
  }
  return mesh;
}

/// Beside a few ordinary triangles: two corners in one place, one in a point, one smaller than a hundredth of
/// a pixel, one a tenth of a pixel, one twenty times as large as the image.
inline Scene odd_scene(int width, int height) {
  Scene scene = scene_of(random_soup(6, 17), width, height);
  Mesh& mesh = scene.meshes[0].mesh;
  const glm::mat4 from_camera = glm::inverse(scene.camera.view * scene.meshes[0].transform);
  Random random(18);
  const auto add = [&](glm::vec3 a, glm::vec3 b, glm::vec3 c) {
    const auto first = static_cast<unsigned>(mesh.positions.size());
    for (const glm::vec3& corner : {a, b, c}) {
      mesh.positions.emplace_back(from_camera * glm::vec4(corner, 1.0F));
      mesh.vertex_colors.push_back(random.vector(0.0F, 1.0F));
    }
    mesh.faces.emplace_back(first, first + 1, first + 2);
  };
  const glm::vec3 a(-0.4F, 0.5F, -5.3F), b(0.6F, -0.2F, -5.1F);
  add(a, a, b);
  add(b, b, b);
  add({0.31F, 0.4F, -5.2F}, {0.31F + 1e-7F, 0.4F, -5.2F}, {0.31F, 0.4F + 1e-7F, -5.2F});
  add({-0.52F, 0.1F, -4.9F}, {-0.505F, 0.1F, -4.9F}, {-0.52F, 0.12F, -4.92F});
  add({-60.0F, -50.0F, -6.9F}, {65.0F, -45.0F, -7.3F}, {3.0F, 80.0F, -6.5F});
  return scene;
}

}  // namespace dpr::test::pipeline
