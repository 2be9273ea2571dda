// The options that the commands share, and how they change a scene.
#include "cli/common_options.hpp"

#include <algorithm>
#include <cstdio>

#include "cli/text.hpp"
#include "dpr/error.hpp"

namespace dpr::cli {
namespace {

void add_smoothing_options(CLI::App& command, SmoothingOptions& s) {
  const auto add = [&](const char* name, auto& value, const char* description, const char* type) {
    command.add_option(name, value, description)->group(k_smoothing_group)->type_name(type);
  };
  const char* const priors = "gaussian|cauchy|logistic|gumbel|uniform";
  const char* const estimators = "exact|monte_carlo";
  add("--preset", s.preset, "Take all values from a named member of the family",
      "softras|opendr|nmr|paper_gaussian|paper_cauchy|gaussian|joint_gaussian|rigid");
  add("--occupancy-prior", s.occupancy_prior, "Noise of the distance", priors);
  add("--depth-prior", s.depth_prior, "Noise of the depth", priors);
  add("--sigma", s.sigma, "Scale of the distance noise, in the unit of the distance", "FLOAT");
  add("--gamma", s.gamma, "Scale of the depth noise; depth is 1 at znear, 0 at zfar", "FLOAT");
  add("--alpha", s.alpha, "Weight of the barrier", "FLOAT");
  add("--composition", s.composition, "How occupancy and depth combine", "barrier|joint");
  add("--estimator", s.estimator, "How both expectations are computed", estimators);
  add("--occupancy-estimator", s.occupancy_estimator, "Overrides --estimator for the occupancy", estimators);
  add("--aggregation-estimator", s.aggregation_estimator, "Overrides --estimator for the aggregation",
      estimators);
  add("--samples", s.samples, "Draws of Monte Carlo", "N");
  add("--variance-reduction", s.variance_reduction, "Control variate of sampled gradients",
      "none|rigid|leave_one_out");
  add("--draws", s.draws, "How the samples' noise is drawn", "independent|antithetic|stratified");
  add("--occupancy-threshold", s.occupancy_threshold, "Sets the blur radius where none is given", "FLOAT");
  add("--blur-radius", s.blur_radius, "Triangles further from a pixel are not there", "FLOAT");
  add("--background-depth", s.background_depth, "Normalised depth of the background", "FLOAT");
  add("--distance", s.distance, "Unit of the distance: NDC^2 or NDC", "squared|euclidean");
  add("--occupancy-width", s.occupancy_width, "Width of uniform noise: sigma, or up to the pixel",
      "fixed|variable");
}

template <typename Value, typename Parse>
void apply_word(const std::optional<std::string>& word, Value& value, Parse parse, const char* flag) {
  if (word) value = parse(*word, flag);
}

template <typename Value>
void apply_value(const std::optional<Value>& given, Value& value) {
  if (given) value = *given;
}

void apply(const SmoothingOptions& options, Scene& scene) {
  Smoothing& smoothing = scene.smoothing;
  if (options.preset) {
    const std::uint64_t seed = smoothing.seed;
    smoothing = smoothing_preset(*options.preset, scene.width, scene.height);
    smoothing.seed = seed;
  }
  apply_word(options.occupancy_prior, smoothing.occupancy_prior, parse_prior, "--occupancy-prior");
  apply_word(options.depth_prior, smoothing.depth_prior, parse_prior, "--depth-prior");
  apply_word(options.composition, smoothing.composition, parse_composition, "--composition");
  apply_word(options.estimator, smoothing.occupancy_estimator, parse_estimator, "--estimator");
  apply_word(options.estimator, smoothing.aggregation_estimator, parse_estimator, "--estimator");
  apply_word(options.occupancy_estimator, smoothing.occupancy_estimator, parse_estimator,
             "--occupancy-estimator");
  apply_word(options.aggregation_estimator, smoothing.aggregation_estimator, parse_estimator,
             "--aggregation-estimator");
  apply_word(options.variance_reduction, smoothing.variance_reduction, parse_variance_reduction,
             "--variance-reduction");
  apply_word(options.draws, smoothing.draws, parse_draws, "--draws");
  apply_word(options.distance, smoothing.distance, parse_distance_metric, "--distance");
  apply_word(options.occupancy_width, smoothing.occupancy_width, parse_occupancy_width, "--occupancy-width");
  apply_value(options.sigma, smoothing.sigma);
  apply_value(options.gamma, smoothing.gamma);
  apply_value(options.alpha, smoothing.alpha);
  apply_value(options.samples, smoothing.samples);
  apply_value(options.occupancy_threshold, smoothing.occupancy_threshold);
  apply_value(options.background_depth, smoothing.background_depth);
  if (options.blur_radius) smoothing.blur_radius = options.blur_radius;
}

/// The same picture with other pixels: intrinsics, which are in pixels, follow.
void resize(Scene& scene, glm::ivec2 size) {
  if (auto& k = scene.camera.intrinsics) {
    const glm::vec2 factor = glm::vec2(size) / glm::vec2(scene.width, scene.height);
    *k = {k->fx * factor.x, k->fy * factor.y, k->cx * factor.x, k->cy * factor.y};
  }
  scene.width = size.x;
  scene.height = size.y;
}

}  // namespace

bool gives_any(const CLI::App& command, const std::string& group) {
  return std::ranges::any_of(command.get_options(), [&](const CLI::Option* option) {
    return option->get_group() == group && option->count() > 0;
  });
}

CLI::Option* add_seed_option(CLI::App& command, const std::function<void(std::uint64_t)>& set,
                             const std::string& description) {
  const auto read = [set](const std::string& text) {
    set(parse_whole_number(text, "--seed (command line)"));
  };
  return command.add_option_function<std::string>("--seed", read, description)->type_name("N");
}

void add_output_options(CLI::App& command, CommonOptions& options) {
  auto* quiet = command.add_flag("--quiet", options.quiet, "Print errors only");
  command.add_flag("--verbose", options.verbose, "Print details; build logs in case of errors")
      ->excludes(quiet);
}

void add_device_options(CLI::App& command, CommonOptions& options) {
  command
      .add_option("--device", options.device, "Which OpenCL device (default: DPR_DEVICE, else the first CPU)")
      ->type_name("cpu|gpu|INDEX|SUBSTRING");
  command
      .add_option("--memory-budget", options.memory_budget,
                  "Device memory for fragments; larger frames are rendered in bands "
                  "(default: a quarter; of a CPU's an eighth, at most 1024)")
      ->check(CLI::Range(1, 1 << 30))
      ->type_name("MiB");
}

void add_common_options(CLI::App& command, CommonOptions& options) {
  add_output_options(command, options);
  add_device_options(command, options);
  command.add_option("--size", options.size, "Size of the image in pixels")->type_name("WxH");
  add_seed_option(
      command, [&](std::uint64_t seed) { options.seed = seed; }, "Seed of everything random");
  add_smoothing_options(command, options.smoothing);
}

Device open_device(const CommonOptions& options) {
  constexpr std::size_t k_mebibyte = 1024 * 1024;
  Device device = dpr::open_device(options.device);
  if (options.memory_budget) device.set_memory_budget(*options.memory_budget * k_mebibyte);
  if (options.verbose) {
    const DeviceInfo& info = device.info();
    std::printf("device %zu: %s, %s, %u lanes\n", info.index, info.platform.c_str(), info.name.c_str(),
                info.lanes);
  }
  return device;
}

void apply(const CommonOptions& options, Scene& scene) {
  if (options.size) resize(scene, parse_size(*options.size));
  apply(options.smoothing, scene);
  apply_value(options.seed, scene.smoothing.seed);
}

void print_notes(const Notes& notes, const CommonOptions& options) {
  if (options.quiet) return;
  for (const std::string& note : notes) std::fprintf(stderr, "dpr: note: %s\n", note.c_str());
}

Scene read_scene(const std::string& file, const CommonOptions& options) {
  Notes notes;
  Scene scene = dpr::read_scene(file, notes);
  print_notes(notes, options);
  apply(options, scene);
  return scene;
}

}  // namespace dpr::cli
