// Lights: kinds that are others' limits, setting them in a renderer, and finding them from images.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "check/comparison.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/determinism.hpp"
#include "pipeline/scenes.hpp"
#include "scene/gradient_table.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

namespace lights_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::reduced;

namespace {

Scene sphere_scene(const std::optional<Lights>& lights) {
  const int size = reduced(40, 8);
  Scene scene = scene_of(make_icosphere(dpr::test::is_reduced() ? 0 : 2), size, size);
  scene.meshes[0].mesh.vertex_colors.clear();  // white
  scene.smoothing = smoothing_preset("pixel");
  scene.lights = lights;
  scene.gradients.lights = true;
  return scene;
}

Image image_of(const Lights& lights) {
  Scene scene = sphere_scene(lights);
  scene.meshes[0].mesh.materials = materials_for(lights.shading);
  return rendered(scene);
}

double largest_difference(const Image& a, const Image& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    const glm::vec4 difference = glm::abs(a.pixels[i] - b.pixels[i]);
    largest = std::max(largest, double(std::max({difference.x, difference.y, difference.z, difference.w})));
  }
  return largest;
}

Lights without_lights(Shading shading = Shading::phong) {
  Lights lights;
  lights.ambient = glm::vec3(0.2F);
  lights.shininess = 10;
  lights.shading = shading;
  return lights;
}

/// Adam at a falling rate on every number of the lights but their colours.
Lights find(Renderer& renderer, ImageLoss& loss, Lights lights, int iterations) {
  Optimizer optimizer({.learning_rate = 1});
  for (int i = 0; i < iterations; ++i) {
    optimizer.set_learning_rate(0.3 * std::pow(3e-3, double(i) / iterations));
    renderer.set_lights(lights);
    renderer.forward();
    loss.evaluate(renderer);
    SceneGradient gradient = renderer.backward(loss);
    std::vector<double> slopes;
    for_each_light_number(gradient, [&](std::string_view key, auto number) {
      const bool is_known = key == "ambient" || key == "diffuse" || key == "specular";
      slopes.push_back(is_known ? 0.0 : static_cast<double>(number));
    });
    auto step = optimizer.step(slopes).begin();
    for_each_light_number(lights,
                          [&](std::string_view, float& number) { number += static_cast<float>(*step++); });
  }
  return lights;
}

Lights find(const Lights& truth, const Lights& start, int iterations) {
  Scene scene = sphere_scene(truth);
  scene.gradients = no_gradients();
  scene.gradients.lights = true;
  Renderer renderer(open_device());
  renderer.set_scene(scene);
  std::vector<View> views(4, View{scene.camera, {scene.meshes[0].transform}});
  for (std::size_t v = 0; v < views.size(); ++v) {
    const float elevation = v % 2 == 0 ? 35 : -35;
    views[v].camera.view = orbit_camera(5.3F, elevation, 90 * static_cast<float>(v)).view;
  }
  renderer.set_views(views);
  renderer.forward();
  std::vector<Image> targets;
  for (std::size_t v = 0; v < views.size(); ++v) targets.push_back(renderer.image(v));
  ImageLoss loss(renderer.device(), LossWeights::only(LossKind::mse), targets);
  return find(renderer, loss, start, iterations);
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("lights: a far point light is a directional one, a spot without cone a point light") {
    for (const Shading shading : k_every_shading) {
      CAPTURE(static_cast<int>(shading));
      const glm::vec3 way(0.5F, 1, 1.5F), diffuse(0.6F, 0.5F, 0.4F), specular(0.3F, 0.2F, 0.4F);
      Lights far = without_lights(shading), directional = far, near = far, spot = far, narrow = far;
      far.point = {{1e5F * way, diffuse, specular}};
      directional.directional = {{-3.0F * way, diffuse, specular}};
      near.point = {{3.0F * way, diffuse, specular}};
      spot.spot = {{3.0F * way, -way, 180, 179, diffuse, specular}};
      narrow.spot = {{3.0F * way, -way, 8, 0, diffuse, specular}};
      CHECK(largest_difference(image_of(far), image_of(directional)) < 1e-4);
      CHECK(largest_difference(image_of(near), image_of(spot)) < 1e-5);
      CHECK(largest_difference(image_of(near), image_of(narrow)) > 0.1);
      CHECK(largest_difference(image_of(near), image_of(directional)) > 1e-2);
    }
  }

  TEST_CASE("lights: the first of the harmonics is ambient light, the next three point along y, z and x") {
    Lights ambient = without_lights(), harmonics = ambient;
    ambient.ambient = glm::vec3(0.5F, 0.4F, 0.6F);
    harmonics.ambient = glm::vec3(0);
    harmonics.harmonics.resize(k_harmonics);
    harmonics.harmonics[0] = std::sqrt(4 * std::numbers::pi_v<float>) * ambient.ambient;
    CHECK(largest_difference(image_of(ambient), image_of(harmonics)) < 1e-5);
    // One side of the sphere gets lighter by as much as the other gets darker.
    harmonics.harmonics[1] = glm::vec3(0.3F);
    const Image image = image_of(harmonics), plain = image_of(ambient);
    const auto change = [&](int row) {
      const auto at = static_cast<std::size_t>(row * image.width + image.width / 2);
      return double(image.pixels[at].x - plain.pixels[at].x);
    };
    if (!dpr::test::is_reduced()) {
      CHECK(change(image.height / 4) > 0.01);
      CHECK(change(image.height / 4) > change(3 * image.height / 4) + 0.01);
    }
  }

  TEST_CASE("lights: setting them is as a scene with them, on one device and on several") {
    const Device device = open_device();
    Renderer renderer(device);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_lights({}), "set_scene");
    renderer.set_scene(sphere_scene({}));
    MultiDeviceRenderer several({open_device()});
    several.set_scene(sphere_scene({}));
    for (const std::optional<Lights>& lights :
         {std::optional(two_lights(Shading::phong)), std::optional(every_light(Shading::phong)),
          std::optional(every_light(Shading::flat)), std::optional(every_light(Shading::microfacet)),
          std::optional(without_lights()), std::optional<Lights>()}) {
      renderer.set_lights(lights);
      several.set_lights(lights);
      CHECK(render(renderer).image.pixels == render(device, sphere_scene(lights)).image.pixels);
      CHECK(several.render()[0].pixels == renderer.image().pixels);
      CHECK(same_bits(render(renderer), render(device, sphere_scene(lights))));
    }
    Lights wrong = every_light(Shading::phong);
    wrong.spot[0].angle_degrees = 0;
    const Image before = renderer.image();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_lights(wrong), "angle_degrees (lights.spot[0])");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, several.set_lights(wrong), "angle_degrees (lights.spot[0])");
    renderer.forward();
    CHECK(renderer.image().pixels == before.pixels);
  }

  TEST_CASE("lights: a light's place and an environment are found from images, to 1%") {
    if (dpr::test::is_reduced()) return;
    Lights truth = without_lights(), start = truth;
    truth.point = {{{1.5F, 2.5F, 3.0F}, {0.6F, 0.5F, 0.4F}, {0.3F, 0.4F, 0.2F}}};
    start.point = truth.point;
    start.point[0].position = {-2.0F, 1.0F, 3.0F};
    const glm::vec3 found = find(truth, start, 1000).point[0].position, wanted = truth.point[0].position;
    CHECK(glm::distance(start.point[0].position, wanted) > 0.5F * glm::length(wanted));
    CHECK(glm::distance(found, wanted) < 0.01F * glm::length(wanted));

    truth = without_lights();
    start = truth;
    Random random(3);
    for (std::size_t k = 0; k < k_harmonics; ++k) truth.harmonics.push_back(random.vector(-0.4F, 0.4F));
    truth.harmonics[0] += glm::vec3(1.5F);
    start.harmonics.resize(k_harmonics);
    const Lights environment = find(truth, start, 400);
    double difference = 0, size = 0;
    for (std::size_t k = 0; k < k_harmonics; ++k) {
      const glm::dvec3 wrong = environment.harmonics[k] - truth.harmonics[k], right = truth.harmonics[k];
      difference += glm::dot(wrong, wrong);
      size += glm::dot(right, right);
    }
    CHECK(std::sqrt(difference / size) < 0.01);
  }
}

}  // namespace lights_test
