// The scenes that the tests of the whole pipeline share: nothing in them is symmetric about a pixel.
#pragma once

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <random>
#include <vector>

#include "dpr/scene.hpp"
#include "support/priors.hpp"

namespace dpr::test::pipeline {

/// Uniform numbers that are the same with every standard library.
class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  float operator()(float low, float high) {
    return low + (high - low) * static_cast<float>(static_cast<double>(engine_()) / 4294967296.0);
  }
  glm::vec3 vector(float low, float high) {
    const float x = (*this)(low, high);
    const float y = (*this)(low, high);
    return {x, y, (*this)(low, high)};
  }

 private:
  std::mt19937 engine_;
};

/// A rotation about a skew axis, a scale, a shift.
inline glm::mat4 placed(float degrees, float scale = 1.0F, glm::vec3 shift = glm::vec3(0)) {
  const glm::mat4 moved = glm::translate(glm::mat4(1.0F), shift);
  return glm::scale(glm::rotate(moved, glm::radians(degrees), glm::vec3(0.3F, 0.8F, 0.52F)),
                    glm::vec3(scale));
}

/// A mesh of about unit size that fills most of the image. Depth spans a tenth of the clipping range, so that
/// gamma mixes what lies behind one another, and the background shows through.
inline Scene scene_of(Mesh mesh, int width, int height) {
  Scene scene;
  scene.smoothing = smoothing_preset("gaussian");
  scene.width = width;
  scene.height = height;
  scene.camera = orbit_camera(5.3F, 24.0F, 37.0F, {0.03F, -0.02F, 0.01F});
  scene.camera.fov_y_degrees = 44.0F;
  scene.camera.zfar = 20.0F;
  scene.background = {0.2F, 0.5F, 0.3F};
  scene.meshes.push_back({std::move(mesh), placed(23.0F)});
  scene.smoothing.sigma = 2e-3F;
  scene.smoothing.gamma = 3e-2F;
  scene.smoothing.background_depth = 0.6F;
  return scene;
}

inline Scene cube_scene(int width, int height) { return scene_of(make_cube(), width, height); }

/// Faces reach nearer than the near plane.
inline Scene scene_from_near(Mesh mesh, int width, int height, const Camera& from, float znear) {
  Scene scene = scene_of(std::move(mesh), width, height);
  scene.camera = from;
  scene.camera.fov_y_degrees = 80.0F;
  scene.camera.znear = znear;
  scene.camera.zfar = 8.0F;
  return scene;
}

/// From within: faces at the camera's sides reach behind it.
inline Scene scene_within(Mesh mesh, int width, int height) {
  return scene_from_near(std::move(mesh), width, height,
                         orbit_camera(0.55F, 21.0F, 37.0F, {0.1F, -0.07F, 0.05F}), 0.2F);
}

/// From outside, with the near plane through the mesh, so that the cut is in sight.
inline Scene scene_cut_open(Mesh mesh, int width, int height) {
  return scene_from_near(std::move(mesh), width, height,
                         orbit_camera(2.2F, 24.0F, 37.0F, {0.03F, -0.02F, 0.01F}), 1.4F);
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

/// Random numbers in all four channels, for a derivative of the image or for a target.
inline Image random_image(int width, int height, float low, float high, unsigned seed = 5) {
  Random random(seed);
  Image image(width, height);
  for (glm::vec4& pixel : image.pixels) pixel = glm::vec4(random.vector(low, high), random(low, high));
  return image;
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

inline Texture random_texture(int width, int height, Wrap wrap, Filter filter, unsigned seed = 7) {
  Random random(seed);
  Texture texture{width, height, {}, wrap, filter};
  for (int i = 0; i < width * height; ++i) texture.texels.push_back(random.vector(0.0F, 1.0F));
  return texture;
}

/// The mesh with coordinates that go beyond the texture on all sides, other ones on both sides of every edge.
inline Mesh textured(Mesh mesh, Texture texture) {
  Random random(8);
  mesh.textures.push_back(std::move(texture));
  for (unsigned i = 0; i < 3 * mesh.faces.size(); ++i) {
    const float u = random(-1.3F, 2.2F);
    mesh.texcoords.emplace_back(u, random(-1.3F, 2.2F));
    if (i % 3 == 2) mesh.face_texcoords.emplace_back(i - 2, i - 1, i);
  }
  return mesh;
}

inline Scene textured_scene(Mesh mesh, Texture texture, int width, int height) {
  Scene scene = scene_of(textured(std::move(mesh), std::move(texture)), width, height);
  scene.gradients.texture = scene.gradients.texcoords = true;
  return scene;
}

inline Lights two_lights(Shading shading) {
  Lights lights;
  lights.ambient = {0.4F, 0.3F, 0.5F};
  lights.point = {{{2.0F, 3.5F, 6.0F}, {0.4F, 0.5F, 0.3F}, {0.5F, 0.3F, 0.6F}},
                  {{5.0F, 0.5F, 3.0F}, {0.3F, 0.2F, 0.6F}, {0.3F, 0.6F, 0.2F}}};
  lights.shininess = 6.0F;
  lights.shading = shading;
  return lights;
}

/// The same with a light of every other kind, and an environment. The edge of the cone falls on what is seen.
inline Lights every_light(Shading shading) {
  Lights lights = two_lights(shading);
  lights.directional = {{{-1.0F, -2.5F, -1.5F}, {0.2F, 0.3F, 0.4F}, {0.4F, 0.3F, 0.2F}}};
  lights.spot = {
      {{3.5F, 2.5F, 4.0F}, {-3.3F, -2.2F, -4.1F}, 18.0F, 4.0F, {0.6F, 0.4F, 0.3F}, {0.2F, 0.5F, 0.4F}}};
  Random random(21);
  for (std::size_t k = 0; k < k_harmonics; ++k) lights.harmonics.push_back(random.vector(-0.3F, 0.3F));
  lights.harmonics[0] += glm::vec3(0.9F, 0.7F, 0.8F);
  return lights;
}

}  // namespace dpr::test::pipeline
