// Many unlike scenes: as a batch, one after the other, and against as many views of a single scene.
#include <chrono>
#include <functional>
#include <vector>

#include "dpr/image_loss.hpp"
#include "dpr/scene_batch.hpp"
#include "experiment.hpp"
#include "measure.hpp"

namespace dpr::experiments {
namespace {

/// Scenes of spheres and tori of different numbers of faces, colours, lights and views; 64x64 pixels, as
/// networks learn from.
std::vector<Scene> unlike_scenes(unsigned count) {
  std::vector<Scene> scenes;
  for (unsigned i = 0; i < count; ++i) {
    Scene scene;
    scene.width = scene.height = 64;
    scene.camera = orbit_camera(2.7F, 30, 360.0F * static_cast<float>(i) / static_cast<float>(count));
    scene.meshes.push_back({make_torus(0.7F, 0.3F, 20 + i, 16 + i % 7)});
    scene.background = glm::vec3(0.1F);
    if (i % 2 == 1) scene.lights.emplace().directional = {{.direction = {0, -1, -0.2F}}};
    scene.smoothing = smoothing_preset("softras");
    scenes.push_back(scene);
  }
  return scenes;
}

Json measure(unsigned repetitions, const std::function<void()>& step) {
  std::vector<double> times;
  for (unsigned i = 0; i <= repetitions; ++i) {
    const auto start = std::chrono::steady_clock::now();
    step();
    const std::chrono::duration<double, std::milli> passed = std::chrono::steady_clock::now() - start;
    if (i > 0) times.push_back(passed.count());  // in the first kernels are compiled and buffers grow
  }
  return bench::quartiles(times);
}

struct Way {
  const char* name;
  std::function<void()> step;
  std::function<std::size_t()> device_bytes;
};

}  // namespace

/// Forward pass, loss and backward pass of all scenes.
void run_batches(const Settings& settings) {
  const unsigned count = settings.smoke ? 3 : 64, repetitions = settings.smoke ? 1 : 15;
  const std::vector<Scene> scenes = unlike_scenes(count);
  const std::vector<Image> targets(count, Image(64, 64, glm::vec4(0.3F)));
  const LossWeights weights = LossWeights::only(LossKind::mse);

  SceneBatch batch(settings.device);
  batch.set_scenes(scenes);
  ImageLoss loss(settings.device, weights, targets), of_one(settings.device, weights, {targets.data(), 1});
  std::vector<Renderer> each;
  for (const Scene& scene : scenes) each.emplace_back(settings.device).set_scene(scene);
  Renderer repeated(settings.device);
  repeated.set_scene(scenes[count / 2]);
  std::vector<View> views;
  for (const Scene& scene : scenes) views.push_back({scene.camera, {glm::mat4(1)}});
  repeated.set_views(views);

  const Way ways[] = {{"batch",
                       [&] {
                         batch.forward();
                         loss.evaluate(batch);
                         batch.backward(loss);
                       },
                       [&] { return batch.statistics().device_bytes; }},
                      {"a renderer for each",
                       [&] {
                         for (Renderer& renderer : each) {
                           renderer.forward();
                           of_one.evaluate(renderer);
                           renderer.backward(of_one);
                         }
                       },
                       [&] { return count * each[count / 2].statistics().device_bytes; }},
                      {"one scene in as many views",
                       [&] {
                         repeated.forward();
                         loss.evaluate(repeated);
                         repeated.backward(loss);
                       },
                       [&] { return repeated.statistics().device_bytes; }}};
  Json rows = Json::array();
  for (const Way& way : ways) {
    const Json milliseconds = measure(repetitions, way.step);
    const double median = milliseconds["median"].get<double>();
    rows.push_back({{"way", way.name},
                    {"milliseconds", milliseconds},
                    {"images_per_second", 1e3 * count / median},
                    {"device_bytes", way.device_bytes()}});
    if (!settings.quiet) {
      std::printf("%-26s %.1f ms, %.0f images/s, %.0f MB\n", way.name, median, 1e3 * count / median,
                  static_cast<double>(way.device_bytes()) / 1e6);
    }
  }
  write_data(settings, "batches", {{"scenes", count}, {"rows", rows}});
}

}  // namespace dpr::experiments
