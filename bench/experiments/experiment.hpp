// The frame of the experiments: each is one command that draws its figures and writes its numbers.
//
// To add one: a file beside this one that defines a function of type Experiment::run, and its line in
// experiments.cpp.
#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "cli/json.hpp"
#include "cli/progress.hpp"
#include "dpr/device.hpp"
#include "dpr/smoothing.hpp"

namespace dpr::experiments {

using cli::Json;

/// Settings of every experiment, from the command line.
struct Settings {
  Device device;
  std::filesystem::path folder;  ///< exists; where everything goes
  bool smoke = false;            ///< seconds, not minutes: few points, small images; the same outputs
  bool quiet = false;
};

struct Experiment {
  const char *name, *description;
  void (*run)(const Settings& settings);
};

/// All of them, in the order of the help.
std::span<const Experiment> experiments();

/// Writes `name`.json: {"experiment", "commit", "device", "build_options", "smoke"} and what `data` holds.
void write_data(const Settings& settings, const std::string& name, const Json& data);

/// Draws `name`.png by gnuplot (cli/plot.hpp). Throws IoError where gnuplot is not installed.
void draw_figure(const Settings& settings, const std::string& name, int width, int height,
                 const std::string& script);

/// A preset with these scales; its blur radius stays the same number of sigmas.
Smoothing scaled_smoothing(const std::string& preset, float sigma, float gamma);

/// Prints a file's path, unless quiet.
void announce(const Settings& settings, const std::string& file);

}  // namespace dpr::experiments
