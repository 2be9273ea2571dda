// The list of the experiments, and what they share.
#include <cstdio>

#include "cli/plot.hpp"
#include "cli/provenance.hpp"
#include "dpr/error.hpp"
#include "dpr/smoothing_options.hpp"
#include "experiment.hpp"

namespace dpr::experiments {

void run_operators(const Settings& settings);
void run_gradient_noise(const Settings& settings);
void run_gallery(const Settings& settings);
void run_estimators(const Settings& settings);
void run_devices(const Settings& settings);
void run_batches(const Settings& settings);
void run_shapes(const Settings& settings);
void run_cameras(const Settings& settings);
void run_lights(const Settings& settings);
void run_textures(const Settings& settings);
void run_photograph(const Settings& settings);
void run_derivative(const Settings& settings);

std::span<const Experiment> experiments() {
  static constexpr Experiment k_experiments[] = {
      {"operators", "The smoothed Heaviside and arg-max, and their derivatives, for each prior (Figure 8)",
       run_operators},
      {"gradient-noise", "The operators' gradients as M samples estimate them, and their spread (Figure 3)",
       run_gradient_noise},
      {"gallery", "Renders for growing sigma and gamma, each composition (Figure 2)", run_gallery},
      {"estimators", "Error, time and error^2 x time of every estimator, and which is best", run_estimators},
      {"devices", "Throughput of a batch of views on more and more parts of the device", run_devices},
      {"batches", "Throughput of unlike scenes in a batch, by themselves, and of one in as many views",
       run_batches},
      {"shapes", "Shape and colours from 24 views, and the paper's alternatives at the same budget",
       run_shapes},
      {"cameras", "Shape and colours from 24 views whose cameras are off, refined or not", run_cameras},
      {"lights", "Lights of every kind found from noisy pictures of a known shape", run_lights},
      {"textures", "A texture found from 24 lit views of a known shape, from grey", run_textures},
      {"photograph", "A face's template bent to a photograph: camera, light, then shape", run_photograph},
      {"derivative", "An image, its derivative by a turn, and a loss's gradient on the surface",
       run_derivative}};
  return k_experiments;
}

Smoothing scaled_smoothing(const std::string& preset, float sigma, float gamma) {
  return resolve_smoothing({.preset = preset, .sigma = sigma, .gamma = gamma});
}

void announce(const Settings& settings, const std::string& file) {
  if (!settings.quiet) std::printf("%s\n", (settings.folder / file).c_str());
}

void write_data(const Settings& settings, const std::string& name, const Json& data) {
  Json file{{"experiment", name}};
  file.update(cli::provenance(settings.device));
  file["smoke"] = settings.smoke;
  file.update(data);
  cli::write_json(settings.folder / (name + ".json"), file);
  announce(settings, name + ".json");
}

void draw_figure(const Settings& settings, const std::string& name, int width, int height,
                 const std::string& script) {
  const std::filesystem::path file = settings.folder / (name + ".png");
  if (!cli::draw(file, width, height, script)) throw IoError(file, "gnuplot is not installed");
  announce(settings, name + ".png");
}

}  // namespace dpr::experiments
