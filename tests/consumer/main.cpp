// Renders the coloured cube with the installed library, writes it to the files that are named, reads them,
// and prints the mean of the silhouette.
#include <dpr/dpr.hpp>
#include <dpr/version.hpp>

#include <cstdio>

/// What stands behind the library's classes is not for its users.
template <class Object>
constexpr bool k_shows_state = requires(const Object& object) {
  object.impl();
}
|| requires(const Object& object) { object.impl_; };
static_assert(!k_shows_state<dpr::Device> && !k_shows_state<dpr::Renderer> &&
              !k_shows_state<dpr::SceneBatch> && !k_shows_state<dpr::AttributeImages> &&
              !k_shows_state<dpr::ImageLoss> && !k_shows_state<dpr::MeshLoss>);

int main(int argc, char** argv) {
  dpr::Scene scene;
  scene.width = scene.height = 32;
  scene.camera.view = dpr::orbit_camera(6.7F, 30, 120).view;
  scene.meshes.push_back({.mesh = dpr::make_cube()});

  dpr::Renderer renderer(dpr::open_device());
  renderer.set_scene(scene);
  renderer.forward();
  const dpr::Image image = renderer.image();

  bool same_sizes = argc > 1;
  for (int i = 1; i < argc; ++i) {
    dpr::write_image(argv[i], image);
    same_sizes = same_sizes && dpr::read_image(argv[i]).pixels.size() == image.pixels.size();
  }

  double sum = 0;
  for (const auto& pixel : image.pixels) sum += pixel.a;
  const double mean_alpha = sum / static_cast<double>(image.pixels.size());
  std::printf("dpr %s, mean alpha %.4f\n", DPR_VERSION, mean_alpha);
  return same_sizes && mean_alpha > 0.05 && mean_alpha < 0.5 ? 0 : 1;
}
