#include "measure_command.hpp"

#include <algorithm>
#include <cstdio>

#include "base/output_file.hpp"
#include "cli/provenance.hpp"
#include "csv.hpp"
#include "dpr/error.hpp"
#include "environment.hpp"
#include "results_file.hpp"
#include "stages.hpp"

namespace dpr::cli {
namespace {

void require_stage(const std::string& stage) {
  if (std::ranges::find(bench::k_stages, stage) != std::end(bench::k_stages)) return;
  std::string names;
  for (const std::string_view known : bench::k_stages) {
    names += (names.empty() ? "" : ", ") + std::string(known);
  }
  throw InvalidArgument("--stage (command line)", "\"" + stage + "\"", "one of " + names);
}

void print(const Json& row) {
  const std::string name = bench::row_name(row);
  if (!bench::is_measured(row)) {
    std::printf("%-44s %s: %s\n", name.c_str(), row["status"].get<std::string>().c_str(),
                row["reason"].get<std::string>().c_str());
    return;
  }
  constexpr double k_kilo = 1e3;
  const Json& transfers = row["transfers"];
  std::printf(
      "%-44s forward %10.3f ms   backward %10.3f ms   %9zu fragments   %8.1f kB to, %8.1f kB from the "
      "device, %zu waits\n",
      name.c_str(), row["forward_ms"]["median"].get<double>(), row["backward_ms"]["median"].get<double>(),
      row["fragments"].get<std::size_t>(), transfers["bytes_to_device"].get<double>() / k_kilo,
      transfers["bytes_from_device"].get<double>() / k_kilo, transfers["host_waits"].get<std::size_t>());
  if (!row.contains("tangents_ms")) return;
  for (const auto& [directions, timing] : row["tangents_ms"].items()) {
    std::printf("   along %s: %10.3f ms", directions.c_str(), timing["median"].get<double>());
  }
  std::printf("\n");
}

void print_stages(const Json& row) {
  constexpr double k_percent = 100;
  for (const auto& [name, stage] : row["stages"].items()) {
    std::printf("   %-10s forward %10.3f ms   backward %10.3f ms", name.c_str(),
                stage["forward_ms"].get<double>(), stage["backward_ms"].get<double>());
    if (stage.contains("tangents_ms"))
      std::printf("   along 6 %10.3f ms", stage["tangents_ms"].get<double>());
    if (stage.contains("gflops")) {
      std::printf("   %8.2f GFLOP/s, %4.1f%% of peak   %7.2f GB/s, %4.1f%%", stage["gflops"].get<double>(),
                  k_percent * stage["fraction_of_peak"].get<double>(), stage["gbytes_per_s"].get<double>(),
                  k_percent * stage["fraction_of_bandwidth"].get<double>());
    }
    std::printf("\n");
  }
}

void keep_stages(Json& row, const std::vector<std::string>& wanted) {
  if (wanted.empty() || !bench::is_measured(row)) return;
  Json kept = Json::object();
  for (const auto& [name, stage] : row["stages"].items()) {
    if (std::ranges::find(wanted, name) != wanted.end()) kept[name] = stage;
  }
  row["stages"] = kept;
}

Json results_head(const Device& device, const bench::Peaks& peaks, const bench::MeasureOptions& options) {
  Json head{{"schema", bench::k_results_schema}};
  head.update(cli::provenance(device));
  head["device"]["peak_gflops"] = peaks.gflops;
  head["device"]["peak_gbytes_per_s"] = peaks.gbytes_per_s;
  head["memory_budget_bytes"] = device.memory_budget();
  head["repetitions"] = options.repetitions;
  head["max_seconds"] = options.max_seconds;
  head["environment"] = bench::environment();
  head["load"] = {{"before", bench::load()}};
  head["results"] = Json::array();
  return head;
}

/// Each once.
std::vector<std::string> chosen_workloads(const BenchMeasureOptions& options) {
  std::vector<std::string> names;
  const auto add = [&](std::string_view name) {
    bench::require_workload(std::string(name));
    if (std::ranges::find(names, name) == names.end()) names.emplace_back(name);
  };
  for (const std::string& name : options.workloads) add(name);
  if (names.empty()) {
    for (const std::string_view name : bench::workload_names()) add(name);
  }
  if (options.sweeps) {
    for (const std::string_view name : bench::sweep_names()) add(name);
  }
  return names;
}

}  // namespace

void run_bench(BenchMeasureOptions options, const CommonOptions& common) {
  const std::vector<std::string> names = chosen_workloads(options);
  for (const std::string& stage : options.stages) require_stage(stage);
  for (const std::string& output : {options.output, options.csv})
    if (!output.empty()) require_writable(output);
  const Device device = open_device(common);
  const double first_image_ms = bench::first_image_ms(device);
  const bench::Peaks peaks = bench::measure_peaks(device);
  if (!common.quiet) {
    std::printf("%s: %.1f GFLOP/s and %.1f GB/s at most; first image after %.0f ms\n",
                device.info().name.c_str(), peaks.gflops, peaks.gbytes_per_s, first_image_ms);
  }
  Json file = results_head(device, peaks, options.each);
  file["first_image_ms"] = first_image_ms;
  for (const std::string& name : names) {
    for (const bench::Workload& workload : bench::make_workloads(name)) {
      for (const bench::Variant& variant : workload.variants) {
        if (!options.presets.empty() &&
            std::ranges::find(options.presets, variant.preset) == options.presets.end())
          continue;
        Json row = bench::measure(device, peaks, workload, variant, options.each);
        keep_stages(row, options.stages);
        if (!common.quiet) print(row);
        const bool details = common.verbose || !options.stages.empty();
        if (details && !common.quiet && bench::is_measured(row)) print_stages(row);
        std::fflush(stdout);
        file["results"].push_back(std::move(row));
      }
    }
    if (file["results"].empty()) continue;
    file["load"]["after"] = bench::load();
    if (!options.output.empty()) write_json(options.output, file);
    if (!options.csv.empty()) write_whole_file(options.csv, bench::to_csv(file));
  }
  if (file["results"].empty())
    throw InvalidArgument("--preset (command line)", "\"" + options.presets.front() + "\"",
                          "one that a chosen workload has");
}

}  // namespace dpr::cli
