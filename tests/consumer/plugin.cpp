// A library that another program loads, with dpr in itself: it shows the one function that it wants to.
#include <dpr/dpr.hpp>

extern "C" __attribute__((visibility("default"))) float plugin_alpha() {
  dpr::Scene scene;
  scene.width = scene.height = 16;
  scene.camera.view = dpr::orbit_camera(6.7F, 30, 120).view;
  scene.meshes.push_back({.mesh = dpr::make_cube()});
  dpr::Renderer renderer(dpr::open_device());
  renderer.set_scene(scene);
  renderer.forward();
  return renderer.image().at(8, 8).a;
}
