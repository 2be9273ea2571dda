// Textures from images: Spot's, found from grey by the gradients of 24 lit 8-bit views of the known shape,
// and compared with the truth in views that were not used.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "dpr/dpr.hpp"
#include "experiment.hpp"
#include "mesh/bounding_box.hpp"
#include "scene/gradient_table.hpp"
#include "views.hpp"

namespace dpr::experiments {
namespace {

constexpr std::size_t k_views = 24, k_held_out = 12, k_shown = 4;
constexpr double k_first_rate = 0.05, k_last_rate = 2e-3;
constexpr float k_blur_pixels = 0.25F;
constexpr float k_covered = 0.99F;  // alpha of the pixels that are compared: the background is known

Scene make_scene(bool smoke) {
  const std::filesystem::path folder = DPR_BENCH_DATA;
  Scene scene;
  scene.width = scene.height = smoke ? 32 : 256;
  scene.meshes.push_back({read_mesh(folder / "spot_control_mesh.obj")});
  Mesh& mesh = scene.meshes[0].mesh;
  const glm::vec3 middle = center(bounding_box(mesh.positions));
  for (glm::vec3& p : mesh.positions) p -= middle;
  mesh.textures[0].filter = Filter::trilinear;
  PointLight light;
  light.position = {2, 4, 5};
  light.diffuse = glm::vec3(0.5F);
  light.specular = glm::vec3(0.05F);
  scene.lights = Lights{.ambient = glm::vec3(0.5F), .point = {light}};
  const float pixel = 2.0F / static_cast<float>(scene.width);  // NDC
  scene.smoothing.sigma = k_blur_pixels * k_blur_pixels * pixel * pixel;
  scene.gradients = no_gradients();
  scene.gradients.texture = true;
  return scene;
}

std::vector<View> views_of(const std::vector<Camera>& cameras) {
  std::vector<View> views;
  for (const Camera& camera : cameras) views.push_back({camera, {glm::mat4(1.0F)}});
  return views;
}

std::vector<Image> render(const Device& device, const Scene& scene, const std::vector<Camera>& cameras) {
  Renderer renderer(device);
  renderer.set_scene(scene);
  renderer.set_views(views_of(cameras));
  renderer.forward();
  std::vector<Image> images;
  for (std::size_t v = 0; v < cameras.size(); ++v) images.push_back(renderer.image(v));
  return images;
}

/// Adam on every texel, at a rate that falls by a constant factor.
std::vector<glm::vec3> find(const Device& device, const Scene& start, const std::vector<Camera>& cameras,
                            const std::vector<Image>& targets, unsigned iterations) {
  Renderer renderer(device);
  renderer.set_scene(start);
  renderer.set_views(views_of(cameras));
  ImageLoss loss(device, LossWeights::only(LossKind::mse), targets);
  Optimizer optimizer({.learning_rate = k_first_rate, .beta2 = 0.99});
  std::vector<glm::vec3> texels = start.meshes[0].mesh.textures[0].texels;
  std::vector<double> slopes(3 * texels.size());
  for (unsigned i = 0; i < iterations; ++i) {
    optimizer.set_learning_rate(k_first_rate * std::pow(k_last_rate / k_first_rate, double(i) / iterations));
    renderer.forward();
    loss.evaluate(renderer);
    const SceneGradient gradient = renderer.backward(loss);
    const std::vector<glm::vec3>& of_texels = gradient.meshes[0].textures[0];
    for (std::size_t k = 0; k < slopes.size(); ++k)
      slopes[k] = static_cast<double>(of_texels[k / 3][static_cast<int>(k % 3)]);
    const std::span<const double> step = optimizer.step(slopes);
    for (std::size_t k = 0; k < slopes.size(); ++k) {
      float& number = texels[k / 3][static_cast<int>(k % 3)];
      number = std::clamp(number + static_cast<float>(step[k]), 0.0F, 1.0F);
    }
    renderer.set_texels(0, 0, texels);
  }
  return texels;
}

Image row_of(const std::vector<Image>& images) {
  return hstack({images.begin(), images.begin() + static_cast<std::ptrdiff_t>(k_shown)});
}

}  // namespace

void run_textures(const Settings& settings) {
  const unsigned iterations = settings.smoke ? 20 : 100;
  const std::vector<Camera> cameras = cameras_around(k_views, 0), held_out = cameras_around(k_held_out, 77);
  Scene scene = make_scene(settings.smoke);
  std::vector<Image> targets = render(settings.device, scene, cameras);
  for (Image& image : targets) round_to_8_bits(image);
  const std::vector<Image> truth = render(settings.device, scene, held_out);

  std::vector<glm::vec3>& texels = scene.meshes[0].mesh.textures[0].texels;
  std::ranges::fill(texels, glm::vec3(0.5F));
  const std::vector<Image> before = render(settings.device, scene, held_out);
  const auto start = std::chrono::steady_clock::now();
  texels = find(settings.device, scene, cameras, targets, iterations);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const std::vector<Image> after = render(settings.device, scene, held_out);
  const double found = psnr(after, truth, k_covered);
  if (!settings.quiet) std::printf("texture: %.2f dB on views held out, %.1f s\n", found, seconds);
  write_data(settings, "textures",
             {{"views", k_views},
              {"held_out", k_held_out},
              {"pixels", scene.width},
              {"texels", texels.size()},
              {"iterations", iterations},
              {"start_held_out_psnr", psnr(before, truth, k_covered)},
              {"held_out_psnr", found},
              {"seconds", seconds}});
  write_image(settings.folder / "textures.png", opaque(vstack({row_of(truth), row_of(after)})));
  announce(settings, "textures.png");
}

}  // namespace dpr::experiments
