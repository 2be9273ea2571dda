// The options that the commands share.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "dpr/device.hpp"
#include "dpr/notes.hpp"
#include "dpr/scene.hpp"

namespace dpr::cli {

/// What the command line says of a Smoothing; what it does not mention stays as the scene has it.
struct SmoothingOptions {
  std::optional<std::string> preset, occupancy_prior, depth_prior, composition, estimator,
      occupancy_estimator, aggregation_estimator, variance_reduction, draws, distance, occupancy_width;
  std::optional<float> sigma, gamma, alpha, occupancy_threshold, blur_radius, background_depth;
  std::optional<std::uint32_t> samples;
};

struct CommonOptions {
  std::string device;
  std::optional<std::string> size;
  std::optional<std::uint64_t> seed;
  std::optional<std::size_t> memory_budget;  // MiB
  SmoothingOptions smoothing;
  bool verbose = false, quiet = false;
};

/// The help group of the smoothing's flags.
inline constexpr const char* k_smoothing_group = "Smoothing (each replaces the scene's value)";
/// Whether the command line gave any option of a help group.
bool gives_any(const CLI::App& command, const std::string& group);

/// --seed, as scene files take it: the command line's library would read -1 as 2^64 - 1.
CLI::Option* add_seed_option(CLI::App& command, const std::function<void(std::uint64_t)>& set,
                             const std::string& description);
/// --device and --memory-budget.
void add_device_options(CLI::App& command, CommonOptions& options);
/// --verbose and --quiet.
void add_output_options(CLI::App& command, CommonOptions& options);
/// Those, and all that a command that renders understands.
void add_common_options(CLI::App& command, CommonOptions& options);

/// The device of --device. Says which one it is if asked to be verbose.
Device open_device(const CommonOptions& options);
/// Puts --size, --seed and the smoothing flags into the scene. Throws InvalidArgument.
void apply(const CommonOptions& options, Scene& scene);
/// What a file asked for and the program leaves out, one line each on stderr; with --quiet nothing.
void print_notes(const Notes& notes, const CommonOptions& options);

/// read_scene(), print_notes() and apply().
Scene read_scene(const std::string& file, const CommonOptions& options);

}  // namespace dpr::cli
