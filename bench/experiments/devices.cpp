// A batch of views on more and more parts of one device: how throughput grows with the devices.
#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

#include "dpr/multi_device.hpp"
#include "experiment.hpp"
#include "measure.hpp"
#include "workloads.hpp"

namespace dpr::experiments {
namespace {

/// The workload's views on some devices, ready to be timed.
MultiDeviceRenderer make_renderer(std::vector<Device> devices, const bench::Workload& workload) {
  MultiDeviceRenderer renderer(std::move(devices));
  Scene scene = workload.scene;
  scene.smoothing = workload.variants.front().smoothing;
  renderer.set_scene(scene);
  renderer.set_views(workload.views);
  const Image grey(scene.width, scene.height, glm::vec4(0.3F));
  renderer.set_loss(LossWeights::only(LossKind::mse), std::vector<Image>(workload.views.size(), grey));
  renderer.evaluate();  // kernels are compiled, buffers grow
  return renderer;
}

double evaluate_milliseconds(MultiDeviceRenderer& renderer) {
  const auto start = std::chrono::steady_clock::now();
  renderer.evaluate();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

/// Times for 1, 2, ... devices, taken in turn so that other work on the machine hits all of them.
std::vector<std::vector<double>> measure_all(std::vector<MultiDeviceRenderer>& renderers,
                                             unsigned repetitions) {
  std::vector<std::vector<double>> times(renderers.size());
  for (unsigned i = 0; i < repetitions; ++i) {
    for (std::size_t r = 0; r < renderers.size(); ++r)
      times[r].push_back(evaluate_milliseconds(renderers[r]));
  }
  return times;
}

}  // namespace

void run_devices(const Settings& settings) {
  const bench::Workload workload = bench::make_workloads("views24").front();
  const std::vector<Device> parts = split_device(settings.device, 1);
  std::vector<MultiDeviceRenderer> renderers;
  for (std::size_t n = 1; n <= parts.size(); ++n)
    renderers.push_back(
        make_renderer({parts.begin(), parts.begin() + static_cast<std::ptrdiff_t>(n)}, workload));

  Json rows = Json::array();
  std::string points;
  double one = 0;
  for (const std::vector<double>& times : measure_all(renderers, settings.smoke ? 1 : 15)) {
    const Json milliseconds = bench::quartiles(times);
    const double median = milliseconds["median"].get<double>();
    if (rows.empty()) one = median;
    const std::size_t devices = rows.size() + 1;
    rows.push_back({{"devices", devices},
                    {"milliseconds", milliseconds},
                    {"views_per_second", 1e3 * static_cast<double>(workload.views.size()) / median},
                    {"speedup", one / median}});
    points += std::to_string(devices) + " " + std::to_string(one / median) + "\n";
    if (!settings.quiet) {
      std::printf("%zu devices of one compute unit: %.1f ms, %.2f times the throughput of one\n", devices,
                  median, one / median);
    }
  }
  write_data(settings, "devices", {{"workload", workload.name}, {"rows", rows}});
  draw_figure(
      settings, "devices", 700, 500,
      "set xlabel 'devices of one compute unit'\nset ylabel 'throughput, of one'\nset key left\n"
      "set xrange [0.5:*]\nset yrange [0:*]\n$points << EOD\n" +
          points +
          "EOD\nplot $points with linespoints lw 2 title 'views24', x with lines dt 2 title 'ideal'\n");
}

}  // namespace dpr::experiments
