#include "workloads.hpp"

#include <algorithm>

#include "dpr/error.hpp"
#include "dpr/mesh.hpp"

namespace dpr::bench {
namespace {

constexpr std::uint32_t k_exact = 0;  // in a list of sample counts

struct Definition {
  std::string_view name;
  unsigned subdivisions;  // of the icosphere; 0: the cube
  int size;
  float sigma, gamma;
  std::vector<std::uint32_t> samples;
  bool softras, joint;
  unsigned views;
};

const std::vector<Definition>& definitions() {
  static const std::vector<Definition> list{
      {"cube128", 0, 128, 1e-3F, 1e-2F, {k_exact, 8, 32, 128}, false, true, 1},
      {"sphere64", 3, 64, 1e-4F, 1e-3F, {k_exact, 8, 32}, true, true, 1},
      {"sphere128", 3, 128, 1e-4F, 1e-3F, {k_exact, 8, 32}, true, true, 1},
      {"sphere256", 3, 256, 1e-4F, 1e-3F, {k_exact, 8, 32}, true, true, 1},
      {"views24", 3, 128, 1e-4F, 1e-3F, {k_exact}, false, false, 24},
      {"sphere20k", 5, 256, 1e-4F, 1e-3F, {k_exact, 8}, false, true, 1},
      {"sphere80k", 6, 512, 1e-4F, 1e-3F, {k_exact, 8}, false, true, 1},
      {"million", 8, 1024, 1e-6F, 1e-3F, {k_exact}, false, false, 1}};
  return list;
}

Scene make_scene(const Definition& d) {
  // The published program's blur radius, and the cameras of its demos.
  constexpr float k_blur_radius_in_sigma = 9.21F;
  constexpr float k_cube_distance = 6.7F, k_sphere_distance = 2.7F;
  Scene scene;
  scene.width = scene.height = d.size;
  const bool cube = d.subdivisions == 0;
  scene.meshes.push_back({cube ? make_cube() : make_icosphere(d.subdivisions)});
  scene.camera = orbit_camera(cube ? k_cube_distance : k_sphere_distance, 30.0F, 120.0F);
  scene.smoothing.sigma = d.sigma;
  scene.smoothing.gamma = d.gamma;
  scene.smoothing.blur_radius = k_blur_radius_in_sigma * d.sigma;
  return scene;
}

std::vector<View> make_views(const Definition& d, const Scene& scene) {
  constexpr float k_full_turn = 360.0F;
  std::vector<View> views;
  for (unsigned i = 0; i < d.views; ++i) {
    Camera camera = scene.camera;
    if (d.views > 1) {
      camera = orbit_camera(2.7F, 30.0F, k_full_turn * static_cast<float>(i) / static_cast<float>(d.views));
    }
    views.push_back({camera, {scene.meshes[0].transform}});
  }
  return views;
}

}  // namespace

std::vector<std::string_view> workload_names() {
  std::vector<std::string_view> names;
  for (const Definition& d : definitions()) names.push_back(d.name);
  return names;
}

std::vector<Workload> make_workloads(std::string_view name) {
  const auto d = std::ranges::find(definitions(), name, &Definition::name);
  if (d == definitions().end()) {
    std::string names;
    for (const std::string_view known : workload_names())
      names += (names.empty() ? "" : ", ") + std::string(known);
    throw InvalidArgument("workload", "'" + std::string(name) + "'", "one of " + names);
  }
  std::vector<Workload> list;
  const Scene scene = make_scene(*d);
  const auto add = [&](const std::string& preset, const Smoothing& smoothing) {
    list.push_back({std::string(name), preset, scene, make_views(*d, scene)});
    list.back().scene.smoothing = smoothing;
  };
  for (const std::uint32_t samples : d->samples) {
    Smoothing smoothing = scene.smoothing;
    if (samples != k_exact) {
      smoothing.occupancy_estimator = smoothing.aggregation_estimator = Estimator::monte_carlo;
      smoothing.samples = samples;
    }
    add("gaussian", smoothing);
  }
  if (d->softras) {
    Smoothing smoothing = scene.smoothing;
    smoothing.occupancy_prior = Prior::logistic;
    smoothing.depth_prior = Prior::gumbel;
    add("softras", smoothing);
  }
  if (d->joint) {
    Smoothing smoothing = scene.smoothing;
    smoothing.composition = Composition::joint;
    add("gaussian", smoothing);
  }
  return list;
}

}  // namespace dpr::bench
