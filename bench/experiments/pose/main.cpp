// The pose experiments as a command: every method asked for on every set asked for; JSON and a figure.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>

#include "base/output_file.hpp"
#include "cli/plot.hpp"
#include "cli/process.hpp"
#include "cli/text.hpp"
#include "dpr/device.hpp"
#include "dpr/error.hpp"
#include "experiments/pose/figures.hpp"
#include "experiments/pose/methods.hpp"
#include "experiments/pose/table.hpp"

namespace dpr::bench {
namespace {

struct Options {
  std::vector<std::string> methods{"default"};
  std::vector<double> angles{20, 50, 80, 0};
  std::vector<std::uint64_t> seeds{1};
  PoseProblemSet set;
  unsigned count = 100;
  int size = 128;
  std::string folder, problems, device;
  bool smoke = false, quiet = false;
};

constexpr std::size_t k_smoke_count = 2;
constexpr int k_smoke_size = 32;

std::vector<std::uint64_t> parse_seeds(const std::vector<std::string>& words) {
  std::vector<std::uint64_t> seeds;
  for (const std::string& word : words)
    seeds.push_back(cli::parse_whole_number(word, "--seed (command line)"));
  return seeds;
}

PoseRun common_of(const Options& options) {
  PoseRun run;
  run.set = options.set;
  run.size = options.smoke ? k_smoke_size : options.size;
  run.smoke = options.smoke;
  run.quiet = options.quiet;
  return run;
}

std::size_t count_of(const Options& options) { return options.smoke ? k_smoke_count : options.count; }

/// The solved part against the threshold: a curve a run.
void draw(const std::filesystem::path& file, const std::vector<cli::Curve>& curves) {
  cli::plot(file,
            {"threshold, degrees", shown_thresholds(), {{"Solved problems", "share solved", false, curves}}});
}

/// Every combination asked for, or the problems of a file.
std::vector<PoseRun> runs_of(const Options& options) {
  PoseRun run = common_of(options);
  std::vector<PoseRun> runs;
  const auto add = [&] {
    for (const std::string& method : options.methods) {
      run.method.name = method;
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
      run.problems = make_pose_problems(run.set, count_of(options));
      add();
    }
  }
  return runs;
}

void run(const Options& options) {
  make_folder(options.folder);
  const Device device = open_device(options.device);
  std::vector<cli::Curve> curves;
  for (const PoseRun& wanted : runs_of(options)) {
    const std::vector<double> angles = final_angles(run_poses(device, wanted, options.folder));
    cli::Curve& curve = curves.emplace_back(cli::Curve{file_stem(wanted), {}});
    for (const double threshold : shown_thresholds()) curve.y.push_back(solved_part(angles, threshold));
  }
  draw(std::filesystem::path(options.folder) / "thresholds.png", curves);
}

void run_figure(const Options& options, const Figure& figure) {
  make_folder(options.folder);
  make_figure(open_device(options.device), figure, common_of(options), count_of(options), options.folder);
}

}  // namespace
}  // namespace dpr::bench

namespace {

using dpr::bench::Figure;
using dpr::bench::Options;

/// Options of a run. Figures choose their own.
void add_set_options(CLI::App& application, Options& options, const char* group) {
  std::string methods = "May be repeated:";
  for (const auto& [name, description] : dpr::bench::pose_method_names()) {
    methods += "\n" + std::string(name) + ": " + std::string(description);
  }
  const auto add = [&](const char* name, auto& value, const std::string& description) {
    application.add_option(name, value, description)->group(group);
  };
  add("--method", options.methods, methods);
  add("--angle", options.angles,
      "Degrees between initial pose and truth, 0 for a uniform initial rotation; may be repeated");
  application
      .add_option_function<std::vector<std::string>>(
          "--seed",
          [&options](const std::vector<std::string>& words) {
            options.seeds = dpr::bench::parse_seeds(words);
          },
          "Seed of the problems; may be repeated")
      ->type_name("N")
      ->group(group);
  add("--object", options.set.object, "cube, published_cube, mailbox, bag or a mesh file");
  add("--translation-error", options.set.translation_error, "Part of the camera's distance");
  add("--occluded", options.set.occluded, "Part of the object that is hidden");
  application.add_flag("--clutter", options.set.clutter, "Random discs instead of the background")
      ->group(group);
  add("--problems", options.problems, "A file of problems instead, as this command writes them");
}

/// The figure asked for, or none.
const Figure* figure_of(const CLI::App& application, const char* set_group) {
  for (const Figure& figure : dpr::bench::figures()) {
    if (!application.got_subcommand(figure.name)) continue;
    for (const CLI::Option* option : application.get_options()) {
      if (option->get_group() == set_group && option->count() > 0) {
        throw dpr::InvalidArgument(option->get_name() + " (command line)",
                                   "beside " + std::string(figure.name), "none: a figure has its own runs");
      }
    }
    return &figure;
  }
  return nullptr;
}

}  // namespace

int main(int argc, char** argv) {
  dpr::cli::prepare_process();
  constexpr const char* k_set_group = "Runs (without a figure)";
  CLI::App application(
      "Pose experiments: methods on problems from seeds, or a figure of the paper. An interrupted run goes "
      "on "
      "where it ended.");
  application.require_subcommand(0, 1);
  application.fallthrough();
  Options options;
  add_set_options(application, options, k_set_group);
  application.add_option("--count", options.count, "Problems a set");
  application.add_option("--size", options.size, "Pixels a side");
  application.add_option("--device", options.device, "cpu, gpu, an index or a part of its name");
  application.add_option("-o,--output", options.folder, "Folder for results and figures")->required();
  application.add_flag("--smoke", options.smoke, "Two problems of few iterations, small images");
  application.add_flag("--quiet", options.quiet, "No progress");
  for (const Figure& figure : dpr::bench::figures()) {
    application.add_subcommand(figure.name, figure.description);
  }
  application.footer("Example: dpr_pose_table figure5 --count 20 -o figures");
  try {
    CLI11_PARSE(application, argc, argv);
    if (const Figure* figure = figure_of(application, k_set_group)) {
      dpr::bench::run_figure(options, *figure);
    } else {
      dpr::bench::run(options);
    }
    dpr::cli::require_printed();
  } catch (const dpr::DeviceError& error) {
    std::fprintf(stderr, "dpr_pose_table: error: %s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "dpr_pose_table: error: %s\n", error.what());
    return 1;
  }
  return 0;
}
