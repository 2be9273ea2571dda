// Renders the coloured cube with the installed library and prints the mean of the silhouette.
#include <dpr/dpr.hpp>

#include <cstdio>

int main() {
  dpr::Scene scene;
  scene.width = scene.height = 32;
  scene.camera.view = dpr::orbit_camera(6.7F, 30, 120).view;
  scene.meshes.push_back({.mesh = dpr::make_cube()});

  dpr::Renderer renderer(dpr::open_device());
  renderer.set_scene(scene);
  renderer.forward();
  const dpr::Image image = renderer.image();

  double sum = 0;
  for (const auto& pixel : image.pixels) sum += pixel.a;
  const double mean_alpha = sum / static_cast<double>(image.pixels.size());
  std::printf("mean alpha %.4f\n", mean_alpha);
  return mean_alpha > 0.05 && mean_alpha < 0.5 ? 0 : 1;
}
