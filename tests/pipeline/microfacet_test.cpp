// Reflection of rough surfaces at its limits: mirrors, edge-on and opposite views and lights, surfaces from behind.
#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "check/comparison.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "support/reduced.hpp"

namespace microfacet_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::reduced;

namespace {

/// A square about the origin that faces +z, seen from a point, in a point light.
Scene square_scene(glm::vec3 eye, glm::vec3 light, const Material& material) {
  const int size = reduced(12, 4);
  Mesh square;
  square.positions = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  square.faces = {{0, 1, 2}, {0, 2, 3}};
  square.materials = {material};
  Scene scene = scene_of(square, size, size);
  scene.meshes[0].transform = glm::mat4(1);
  scene.camera.view = glm::lookAt(eye, glm::vec3(0), glm::vec3(0, 1, 0.1F));
  scene.camera.znear = 0.1F;
  scene.camera.zfar = 20;
  scene.lights = Lights{};
  scene.lights->shading = Shading::microfacet;
  scene.lights->point = {{light, glm::vec3(0.5F), glm::vec3(0.5F)}};
  scene.gradients.lights = scene.gradients.materials = true;
  return scene;
}

/// Numbers of all gradients that light has a part in.
std::vector<double> numbers_of(const SceneGradient& g) {
  std::vector<double> numbers = light_numbers(g);
  const MeshGradient& mesh = g.meshes[0];
  for (const std::vector<double>& more :
       {flat(mesh.positions), flat(mesh.colors), flat(mesh.specular), mesh.shininess,
        flat<glm::dvec3>({g.views[0].camera.view.translation})})
    numbers.insert(numbers.end(), more.begin(), more.end());
  return numbers;
}

}  // namespace

TEST_SUITE("robustness") {
  TEST_CASE("microfacet: images and gradients are finite at every limit") {
    const glm::vec3 front(0, 0, 4), along(4, 0, 1e-4F), behind(0.3F, 0, -4);
    Renderer renderer(open_device());
    for (const glm::vec3& eye : {front, along, behind}) {
      for (const glm::vec3& light : {-eye, eye, along, glm::vec3(0), glm::vec3(0, 1e6F, 1)}) {
        if (test::is_reduced() && light != -eye) continue;
        for (const float shininess : {1.0F, 1e6F, 1e30F}) {
          CAPTURE(eye.x);
          CAPTURE(light.x);
          CAPTURE(shininess);
          const Scene scene = square_scene(eye, light, {glm::vec3(0.04F, 0.5F, 1), shininess});
          renderer.set_scene(scene);
          renderer.forward();
          for (const glm::vec4& pixel : renderer.image().pixels)
            CHECK(std::isfinite(pixel.x + pixel.y + pixel.z + pixel.w));
          const Image weights = random_image(scene.width, scene.height, 0.5F, 1);
          const SceneGradient g = renderer.backward(std::span(&weights, 1));
          for (const double number : numbers_of(g)) CHECK(std::isfinite(number));
          if (eye != front || light != eye) continue;
          CHECK(norm(flat(g.meshes[0].specular)) > 0);
          CHECK((g.meshes[0].shininess[0] == 0) == (shininess == 1e30F));  // alpha^2 is clamped
        }
      }
    }
  }
}

}  // namespace microfacet_test
