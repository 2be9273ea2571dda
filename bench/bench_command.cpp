// dpr bench: measures the workloads, compares files of results, draws them.
#include "bench_command.hpp"

#include <algorithm>
#include <cstdio>
#include <iterator>
#include <memory>

#include "cli/completion.hpp"
#include "cli/file_options.hpp"
#include "compare.hpp"
#include "device_ranking.hpp"
#include "dpr/error.hpp"
#include "measure_command.hpp"
#include "report/report.hpp"

namespace dpr::cli {
namespace {

struct BenchOptions {
  BenchMeasureOptions measure;
  std::vector<std::string> compared, files;
  std::string report;
  double fail_above = 0;  ///< 0: a comparison never fails
};

void run_compare(const BenchOptions& options, const CommonOptions& common) {
  const Json comparison =
      bench::compare(bench::read_results(options.compared[0]), bench::read_results(options.compared[1]));
  if (!common.quiet) std::printf("%s", bench::to_lines(comparison).c_str());
  if (!options.measure.output.empty()) write_json(options.measure.output, comparison);
  if (options.fail_above > 0) bench::require_none_slower(comparison, options.fail_above);
}

void run_report(const BenchOptions& options, const CommonOptions& common) {
  if (options.files.empty()) {
    throw InvalidArgument("files (command line)", "none", "one or more files of results after --report DIR");
  }
  std::vector<Json> results;
  for (const std::string& file : options.files) results.push_back(bench::read_results(file));
  require_outputs({}, options.report);
  for (const std::string& picture : bench::write_report(options.report, results, common.command_line)) {
    if (!common.quiet) std::printf("%s\n", picture.c_str());
  }
}

void run(const BenchOptions& options, const CommonOptions& common) {
  const bool writes =
      !options.measure.output.empty() || !options.measure.csv.empty() || !options.report.empty();
  if (common.quiet && !writes && options.fail_above == 0)
    throw InvalidArgument("--quiet (command line)", "nothing to write",
                          "-o FILE, --csv FILE or --report DIR beside it");
  if (options.fail_above > 0 && options.compared.empty())
    throw InvalidArgument("--fail-above (command line)", "no --compare", "--compare A.json B.json beside it");
  if (!options.compared.empty()) return run_compare(options, common);
  if (!options.report.empty()) return run_report(options, common);
  if (!options.files.empty()) {
    throw InvalidArgument("files (command line)", "\"" + options.files.front() + "\"",
                          "none without --report");
  }
  if (!options.measure.devices.empty()) return rank_devices(options.measure, common);
  run_bench(options.measure, common);
}

/// Text of --help after the options.
std::string footer() {
  std::string text = "Workloads:\n";
  for (const auto& names : {bench::workload_names(), bench::sweep_names()}) {
    for (const std::string_view name : names) {
      const std::string pad(20 - name.size(), ' ');
      text += "  " + std::string(name) + pad + std::string(bench::describe(name)) + "\n";
    }
  }
  return text +
         "--compare calls a row faster or slower where the medians differ by more than 5% and the middle "
         "halves of the\n"
         "runs do not overlap; unclear where they do, or with fewer than 5 runs; the same within 5%.\n"
         "Example: dpr bench --workload sphere256 -o results.json";
}

void add_measure_options(CLI::App& command, BenchMeasureOptions& options) {
  CLI::Option* const workload =
      command
          .add_option("--workload", options.workloads,
                      "Workload to measure, may be repeated; all but sweeps if left out")
          ->type_name("NAME");
  std::vector<std::string_view> names = bench::workload_names();
  std::ranges::copy(bench::sweep_names(), std::back_inserter(names));
  complete_with(*workload, names);
  command.add_option("--preset", options.presets, "Measure the rows of this preset only, may be repeated")
      ->check(CLI::IsMember(
          std::vector<std::string>{"gaussian", "softras", "default", "pixel", "pixel-sharp", "sharp"}))
      ->type_name("NAME");
  command.add_flag("--sweeps", options.sweeps, "Measure the sweeps too");
  command
      .add_option("--stage", options.stages, "Print and keep the figures of this stage only, may be repeated")
      ->type_name("NAME");
  command.add_flag("--tangents", options.each.tangents,
                   "Measure forward mode too: tangents along one direction and along six");
  command.add_option("--devices", options.devices, "Rank every device on one workload (default: sphere256)")
      ->check(CLI::IsMember({"all"}))
      ->type_name("all");
  command.add_option("-o,--output", options.output, "Results, or the comparison, as JSON")->type_name("FILE");
  command.add_option("--csv", options.csv, "Results as comma-separated values, a line a row")
      ->type_name("FILE");
  command
      .add_option("--repetitions", options.each.repetitions, "Timed runs of each row, after one to warm up")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command.add_option("--max-seconds", options.each.max_seconds, "A slow row stops repeating after that")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
}

}  // namespace

void add_bench_options(CLI::App& application, CommonOptions& common) {
  const auto options = std::make_shared<BenchOptions>();
  add_measure_options(application, options->measure);
  auto* compare =
      application.add_option("--compare", options->compared, "Two files of results, the earlier first")
          ->expected(2)
          ->type_name("A.json B.json");
  application
      .add_option("--fail-above", options->fail_above,
                  "Exit status 1 where --compare finds a row slower by more than this ratio")
      ->check(CLI::Range(1.0, 1e6))
      ->type_name("RATIO");
  application
      .add_option("--report", options->report,
                  "Folder for plots of the files of results that follow, and a page that shows them")
      ->type_name("DIR")
      ->excludes(compare);
  application.add_option("files", options->files, "Files of results, for --report")->type_name("R.json");
  add_device_options(application, common);
  add_output_options(application, common);
  application.footer(footer());
  application.callback([options, &common] { run(*options, common); });
}

}  // namespace dpr::cli
