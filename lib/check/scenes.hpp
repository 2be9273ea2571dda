// The scenes of the self-test and of the tests of the whole pipeline: nothing in them is symmetric about a
// pixel.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "dpr/image.hpp"
#include "dpr/scene.hpp"

namespace dpr::check {

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

/// From outside, with the near plane through the mesh, so that the cut is in sight.
inline Scene scene_cut_open(Mesh mesh, int width, int height) {
  return scene_from_near(std::move(mesh), width, height,
                         orbit_camera(2.2F, 24.0F, 37.0F, {0.03F, -0.02F, 0.01F}), 1.4F);
}

/// A cube on eight vertices, so that no move tears it. Each triangle has a colour of its own, so that all
/// edges are contours.
inline Mesh welded_cube() {
  Random random(3);
  const Mesh cube = make_cube();
  Mesh mesh;
  for (const glm::uvec3& face : cube.faces) {
    glm::uvec3 welded;
    for (int i = 0; i < 3; ++i) {
      const glm::vec3 corner = cube.positions[face[i]];
      const auto found = std::ranges::find(mesh.positions, corner);
      welded[i] = static_cast<unsigned>(found - mesh.positions.begin());
      if (found == mesh.positions.end()) mesh.positions.push_back(corner);
    }
    mesh.faces.push_back(welded);
    mesh.face_colors.push_back(random.vector(0, 1));
  }
  return mesh;
}

/// Random numbers in all four channels, for a derivative of the image or for a target.
inline Image random_image(int width, int height, float low, float high, unsigned seed = 5) {
  Random random(seed);
  Image image(width, height);
  for (glm::vec4& pixel : image.pixels) pixel = glm::vec4(random.vector(low, high), random(low, high));
  return image;
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

inline constexpr std::array k_every_shading{Shading::flat, Shading::phong, Shading::gouraud, Shading::blinn,
                                            Shading::microfacet};

/// Materials by which a shading shows all that it has: without any, microfacet's lights scatter nothing.
inline std::vector<Material> materials_for(Shading shading) {
  if (shading != Shading::microfacet) return {};
  return {{{0.7F, 0.3F, 0.1F}, std::nullopt}};
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

}  // namespace dpr::check
