// Minimises a loss: finds the place of a sphere from one image of it.
#include <cstdio>
#include <dpr/dpr.hpp>

int main() {
  const dpr::Device device = dpr::open_device();
  dpr::Scene scene;
  scene.width = scene.height = 64;
  scene.camera = dpr::orbit_camera(/*distance*/ 5, /*elevation*/ 20, /*azimuth*/ 30);
  scene.meshes.push_back({.mesh = dpr::make_icosphere(2)});

  dpr::Renderer renderer(device);
  renderer.set_scene(scene);
  renderer.forward();
  const dpr::Image target = renderer.image();
  dpr::ImageLoss loss(device, {.mse = 1}, {&target, 1});

  glm::dvec3 place(0.5, -0.3, 0.2);  // the target has the sphere at the origin
  dpr::View view{scene.camera, {glm::mat4(1)}};
  dpr::Optimizer optimizer({.learning_rate = 0.03});
  double value = 0;
  for (int i = 0; i < 60; ++i) {
    view.transforms[0][3] = glm::vec4(place, 1);
    renderer.set_views({&view, 1});
    renderer.forward();
    value = loss.evaluate(renderer);
    const glm::dvec3 gradient = renderer.backward(loss).views[0].transforms[0].translation;
    const auto step = optimizer.step({&gradient[0], 3});
    place += glm::dvec3(step[0], step[1], step[2]);
  }
  std::printf("loss %.2g, %.3f from the place\n", value, glm::length(place));
  return glm::length(place) < 0.05 ? 0 : 1;
}
