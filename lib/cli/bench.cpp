// dpr bench: times forward and backward passes over the workloads.
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>

#include "cli/commands.hpp"
#include "cli/json.hpp"
#include "dpr/loss.hpp"
#include "dpr/renderer.hpp"
#include "workloads.hpp"

namespace dpr::cli {
namespace {

constexpr int k_results_schema = 1;

struct BenchOptions {
  std::vector<std::string> workloads;
  std::string output;
  unsigned repetitions = 15;
};

/// Median and quartiles, milliseconds.
Json to_json(std::vector<double> milliseconds) {
  std::ranges::sort(milliseconds);
  const std::size_t n = milliseconds.size();
  return {{"median", milliseconds[n / 2]},
          {"q1", milliseconds[n / 4]},
          {"q3", milliseconds[std::min(n - 1, 3 * n / 4)]},
          {"n", n}};
}

double milliseconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

std::size_t peak_resident_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::size_t>(usage.ru_maxrss) * 1024;  // Linux counts in KiB
}

/// Forward: until the image is on the host. Backward: loss, and every gradient of the scene on the host.
Json measure(const Device& device, const bench::Workload& workload, unsigned repetitions) {
  Renderer renderer(device);
  renderer.set_scene(workload.scene);
  renderer.set_views(workload.views);
  const std::vector<Image> targets(workload.views.size(),
                                   Image(workload.scene.width, workload.scene.height, glm::vec4(0.3F)));
  ImageLoss loss(device, LossWeights::only(LossKind::mse), targets);
  std::vector<double> forward, backward;
  for (unsigned i = 0; i <= repetitions; ++i) {  // the first warms up: kernels are compiled, buffers grow
    const auto start = std::chrono::steady_clock::now();
    renderer.forward();
    for (std::size_t view = 0; view < workload.views.size(); ++view) renderer.image(view);
    const double forward_ms = milliseconds_since(start);
    const auto middle = std::chrono::steady_clock::now();
    loss.evaluate(renderer);
    renderer.backward(loss);
    if (i == 0) continue;
    forward.push_back(forward_ms);
    backward.push_back(milliseconds_since(middle));
  }
  const Smoothing& smoothing = workload.scene.smoothing;
  const bool exact = smoothing.aggregation_estimator == Estimator::exact;
  const RenderStatistics statistics = renderer.statistics();
  return {{"workload", workload.name},
          {"preset", workload.preset},
          {"composition", to_string(smoothing.composition)},
          {"estimator", to_string(smoothing.aggregation_estimator)},
          {"samples", exact ? 0 : smoothing.samples},
          {"forward_ms", to_json(forward)},
          {"backward_ms", to_json(backward)},
          {"fragments", statistics.fragments},
          {"peak_device_bytes", statistics.device_bytes},
          {"peak_rss_bytes", peak_resident_bytes()},
          {"status", "ok"},
          {"reason", ""}};
}

void print(const Json& result) {
  std::printf("%-10s %-8s %-7s %-11s %4u   forward %9.2f ms   backward %9.2f ms   %9zu fragments\n",
              result["workload"].get<std::string>().c_str(), result["preset"].get<std::string>().c_str(),
              result["composition"].get<std::string>().c_str(),
              result["estimator"].get<std::string>().c_str(), result["samples"].get<unsigned>(),
              result["forward_ms"]["median"].get<double>(), result["backward_ms"]["median"].get<double>(),
              result["fragments"].get<std::size_t>());
  std::fflush(stdout);
}

void run(const BenchOptions& options, const CommonOptions& common) {
  const Device device = open_device(common);
  const DeviceInfo& info = device.info();
  Json results = Json::array();
  for (const std::string& name : options.workloads) {
    for (const bench::Workload& workload : bench::make_workloads(name)) {
      results.push_back(measure(device, workload, options.repetitions));
      if (!common.quiet) print(results.back());
    }
  }
  if (options.output.empty()) return;
  write_json(options.output, {{"schema", k_results_schema},
                              {"commit", DPR_COMMIT},
                              {"device",
                               {{"platform", info.platform},
                                {"name", info.name},
                                {"type", info.type},
                                {"version", info.version},
                                {"driver", info.driver},
                                {"compute_units", info.compute_units},
                                {"lanes", info.lanes}}},
                              {"results", results}});
}

}  // namespace

void add_bench_command(CLI::App& application, CommonOptions& common) {
  CLI::App* command = application.add_subcommand("bench", "Measures forward and backward passes");
  const auto options = std::make_shared<BenchOptions>();
  for (const std::string_view name : bench::workload_names()) options->workloads.emplace_back(name);
  command->add_option("--workload", options->workloads,
                      "Workload to measure, may be repeated; all if left out");
  command->add_option("-o,--output", options->output, "Results as JSON");
  command->add_option("--repetitions", options->repetitions, "Timed runs of each, after one to warm up")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command->add_option("--device", common.device, "cpu, gpu, an index or a part of the name");
  add_output_options(*command, common);
  command->footer("Example: dpr bench --workload sphere256 -o results.json");
  command->callback([options, &common] { run(*options, common); });
}

}  // namespace dpr::cli
