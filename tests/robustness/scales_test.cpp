// Lengths and smoothing at the ends of single precision: the same image, or an error that says why there is
// none.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <vector>

#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "support/messages.hpp"

namespace scales_test {

using namespace dpr;
using namespace dpr::test::pipeline;

namespace {

/// The scene in another unit of length.
Scene scaled(Scene scene, float unit) {
  for (Instance& instance : scene.meshes) {
    instance.transform = glm::scale(glm::mat4(1.0F), glm::vec3(unit)) * instance.transform;
  }
  scene.camera.view[3] = glm::vec4(unit * glm::vec3(scene.camera.view[3]), 1.0F);
  scene.camera.znear *= unit;
  scene.camera.zfar *= unit;
  return scene;
}

Scene joint_cube() {
  Scene scene = cube_scene(12, 9);
  scene.smoothing.composition = Composition::joint;
  return scene;
}

float worst(const Image& a, const Image& b) {
  float worst = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    for (int c = 0; c < 4; ++c) {
      const float error = std::fabs(a.pixels[i][c] - b.pixels[i][c]);
      if (!(error <= worst)) worst = error;
    }
  }
  return worst;
}

SceneGradient gradient_of(Renderer& renderer, const Scene& scene, float grad = 1) {
  renderer.set_scene(scene);
  renderer.forward();
  return renderer.backward(std::vector<Image>{Image(scene.width, scene.height, glm::vec4(grad))});
}

}  // namespace

TEST_SUITE("robustness") {
  TEST_CASE("scales: an image and its gradients do not depend on the unit of length") {
    Renderer renderer(open_device());
    for (const Composition composition : {Composition::joint, Composition::barrier}) {
      Scene scene = joint_cube();
      scene.smoothing.composition = composition;
      const SceneGradient expected = gradient_of(renderer, scene);
      const Image image = renderer.image();
      for (const float unit : {1e20F, 1e-25F}) {
        CAPTURE(unit);
        const SceneGradient found = gradient_of(renderer, scaled(scene, unit));
        CHECK(worst(renderer.image(), image) < 1e-4F);
        for (std::size_t v = 0; v < expected.meshes[0].positions.size(); ++v) {
          const glm::vec3 &f = found.meshes[0].positions[v], &e = expected.meshes[0].positions[v];
          CHECK(glm::length(f - e) < 1e-3F * (1 + glm::length(e)));
        }
      }
    }
  }

  TEST_CASE("scales: what single precision cannot hold is refused, and the message says what it is") {
    Renderer renderer(open_device());
    Scene scene = joint_cube();
    scene.smoothing.gamma = 1e-42F;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_scene(scene), "gamma (smoothing): got 1e-42");
    scene.smoothing.gamma = 1e-30F;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_scene(scaled(scene, 1e-25F)),
                          "gamma (smoothing): got 1e-30");
    scene = joint_cube();
    scene.lights = two_lights(Shading::phong);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_scene(scaled(scene, 1e20F)), "with lights");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_scene(scaled(scene, 1e-25F)), "with lights");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_scene(scaled(joint_cube(), 1e36F)),
                          "zfar - znear (camera)");
  }

  TEST_CASE("scales: the least depth noise there may be gives the rigid depths, in every prior") {
    Renderer renderer(open_device());
    for (const Prior prior :
         {Prior::gaussian, Prior::cauchy, Prior::logistic, Prior::gumbel, Prior::uniform}) {
      for (const Composition composition : {Composition::joint, Composition::barrier}) {
        if (prior == Prior::cauchy && composition == Composition::joint) continue;  // is not exact
        CAPTURE(to_string(prior));
        CAPTURE(to_string(composition));
        Scene scene = cube_scene(12, 9);
        scene.smoothing.composition = composition;
        scene.smoothing.depth_prior = prior;
        scene.smoothing.gamma = 1e-15F;
        renderer.set_scene(scene);
        renderer.forward();
        const Image expected = renderer.image();
        scene.smoothing.gamma = 1e-30F;
        const SceneGradient gradient = gradient_of(renderer, scene);
        CHECK(worst(renderer.image(), expected) < 1e-4F);
        CHECK(std::isfinite(gradient.gamma));
      }
    }
  }

  TEST_CASE("scales: a dropped face has no gradient, however far away it is") {
    Renderer renderer(open_device());
    for (const bool lit : {false, true}) {
      CAPTURE(lit);
      Scene scene = cube_scene(12, 9);
      if (lit) scene.lights = two_lights(Shading::phong);
      Mesh& mesh = scene.meshes[0].mesh;
      const SceneGradient expected = gradient_of(renderer, scene);
      const std::size_t first = mesh.positions.size();
      for (const glm::vec3& corner :
           {glm::vec3(1e19F, 0, 0), glm::vec3(0, 3e38F, 0), glm::vec3(0, 1e19F, -2e38F)}) {
        mesh.positions.push_back(corner);
        if (!mesh.vertex_colors.empty()) mesh.vertex_colors.emplace_back(1.0F);
      }
      if (!mesh.face_colors.empty()) mesh.face_colors.emplace_back(1.0F);
      const auto corner = static_cast<unsigned>(first);
      mesh.faces.emplace_back(corner, corner + 1, corner + 2);
      const SceneGradient found = gradient_of(renderer, scene);
      for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
        const glm::vec3 wanted = v < first ? expected.meshes[0].positions[v] : glm::vec3(0);
        CHECK(found.meshes[0].positions[v] == wanted);
      }
      CHECK(found.views[0].transforms[0].rotation == expected.views[0].transforms[0].rotation);
    }
  }

  TEST_CASE("scales: a gradient that is not finite is an error that names it") {
    Renderer renderer(open_device());
    Scene scene = cube_scene(12, 9);
    scene.background = glm::vec3(1e20F);
    scene.gradients = {true, false, false, false, false, false, false};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, gradient_of(renderer, scene, 1e25F),
                          "gradient of meshes[0].positions[");
    scene.gradients = {false, false, false, false, false, true, false};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, gradient_of(renderer, scene, 1e25F), "gradient of ");
  }
}

}  // namespace scales_test
