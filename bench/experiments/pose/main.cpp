// The pose experiments as a command: every method asked for on every set asked for; JSON and a figure.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>

#include "cli/plot.hpp"
#include "dpr/device.hpp"
#include "dpr/error.hpp"
#include "experiments/pose/methods.hpp"
#include "experiments/pose/table.hpp"

namespace dpr::bench {
namespace {

struct Options {
  std::vector<std::string> methods{"default"};
  std::vector<double> angles{20, 50, 80, 0};
  std::vector<std::uint64_t> seeds{1};
  PoseProblemSet set;
  std::size_t count = 100;
  int size = 128;
  std::string folder, problems, device;
  bool smoke = false, quiet = false;
};

constexpr std::size_t k_smoke_count = 2;
constexpr int k_smoke_size = 32;

std::string file_stem(const PoseRun& run) {
  const PoseProblemSet& set = run.set;
  char text[64];
  std::snprintf(text, sizeof text, "-%g%s%s%s-seed%llu-", set.initial_degrees,
                set.translation_error > 0 ? "-6d" : "", set.clutter ? "-clutter" : "",
                set.occluded > 0 ? "-occluded" : "", static_cast<unsigned long long>(set.seed));
  return std::filesystem::path(set.object).stem().string() + text + run.method;
}

/// The solved part against the threshold, 1 to 45 degrees: a curve a run.
void draw(const std::filesystem::path& file,
          const std::vector<std::pair<std::string, std::vector<double>>>& runs) {
  constexpr int k_last = 45;
  std::vector<double> thresholds;
  for (int degrees = 1; degrees <= k_last; ++degrees) thresholds.push_back(degrees);
  cli::Panel panel{"solved", false, {}};
  for (const auto& [name, angles] : runs) {
    cli::Curve curve{name, {}};
    for (const double threshold : thresholds) {
      const auto below = std::ranges::lower_bound(angles, threshold) - angles.begin();
      curve.y.push_back(static_cast<double>(below) /
                        static_cast<double>(std::max(angles.size(), std::size_t{1})));
    }
    panel.curves.push_back(curve);
  }
  cli::plot(file, "threshold, degrees", thresholds, {panel});
}

void print(const std::string& name, const cli::Json& s) {
  const auto percent = [&](const char* key) { return 100 * s[key].get<double>(); };
  std::printf(
      "%-36s %3zu problems  below 10: %5.1f%% (or same image: %5.1f%%)  5: %5.1f%%  2: %5.1f%%  average "
      "%7.3f  "
      "median %7.3f  %6.2f s (%6.2f CPU s)\n",
      name.c_str(), s["problems"].get<std::size_t>(), percent("below_10_degrees"),
      percent("below_10_degrees_or_same_image"), percent("below_5_degrees"), percent("below_2_degrees"),
      s["average_degrees"].get<double>(), s["median_degrees"].get<double>(),
      s["median_seconds"].get<double>(), s["median_cpu_seconds"].get<double>());
  std::fflush(stdout);
}

/// Every combination asked for, or the problems of a file.
std::vector<PoseRun> runs_of(const Options& options) {
  PoseRun run;
  run.set = options.set;
  run.size = options.smoke ? k_smoke_size : options.size;
  run.smoke = options.smoke;
  run.quiet = options.quiet;
  std::vector<PoseRun> runs;
  const auto add = [&] {
    for (const std::string& method : options.methods) {
      run.method = method;
      runs.push_back(run);
    }
  };
  if (!options.problems.empty()) {
    run.problems = read_pose_problems(options.problems, run.set);
    add();
    return runs;
  }
  for (const double angle : options.angles) {
    for (const std::uint64_t seed : options.seeds) {
      run.set.initial_degrees = angle;
      run.set.seed = seed;
      run.problems = make_pose_problems(run.set, options.smoke ? k_smoke_count : options.count);
      add();
    }
  }
  return runs;
}

void run(const Options& options) {
  const std::filesystem::path folder = options.folder;
  std::filesystem::create_directories(folder);
  const Device device = open_device(options.device);
  std::vector<std::pair<std::string, std::vector<double>>> curves;
  for (const PoseRun& wanted : runs_of(options)) {
    const std::string stem = file_stem(wanted);
    write_pose_problems(folder / (stem.substr(0, stem.rfind('-')) + "-problems.json"), wanted.set,
                        wanted.problems);
    const cli::Json results = run_poses(device, wanted, folder / (stem + ".json"));
    print(stem, results["summary"]);
    curves.emplace_back(stem, final_angles(results));
  }
  draw(folder / "thresholds.png", curves);
}

}  // namespace
}  // namespace dpr::bench

int main(int argc, char** argv) {
  CLI::App application(
      "Pose experiments: methods on problems from seeds. An interrupted run goes on where it ended.");
  dpr::bench::Options options;
  application.add_option(
      "--method", options.methods,
      "default, softras, paper_gaussian, paper_cauchy, exact, joint, anneal; may be repeated");
  application.add_option(
      "--angle", options.angles,
      "Degrees between initial pose and truth, 0 for a uniform initial rotation; may be repeated");
  application.add_option("--seed", options.seeds, "Seed of the problems; may be repeated");
  application.add_option("--object", options.set.object, "cube, mailbox, bag or a mesh file");
  application.add_option("--translation-error", options.set.translation_error,
                         "Part of the camera's distance");
  application.add_option("--occluded", options.set.occluded, "Part of the object that is hidden");
  application.add_flag("--clutter", options.set.clutter, "Random discs instead of the background");
  application.add_option("--count", options.count, "Problems a set");
  application.add_option("--size", options.size, "Pixels a side");
  application.add_option("--problems", options.problems,
                         "A file of problems instead, as this command writes them");
  application.add_option("--device", options.device, "cpu, gpu, an index or a part of its name");
  application.add_option("-o,--output", options.folder, "Folder for results and figure")->required();
  application.add_flag("--smoke", options.smoke, "Two problems of few iterations, small images");
  application.add_flag("--quiet", options.quiet, "No progress");
  CLI11_PARSE(application, argc, argv);
  try {
    dpr::bench::run(options);
  } catch (const dpr::DeviceError& error) {
    std::fprintf(stderr, "dpr: error: %s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "dpr: error: %s\n", error.what());
    return 1;
  }
  return 0;
}
