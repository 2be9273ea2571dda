// The named members of the family.
#include <algorithm>
#include <array>

#include "base/checks.hpp"
#include "smoothing/choice_names.hpp"
#include "smoothing/priors.hpp"

namespace dpr {
namespace {

/// The blur radius of SoftRas, of PyTorch3D and of the published program: where the logistic occupancy is
/// 1e-4.
float published_blur_radius(float sigma) {
  return static_cast<float>(reach(Prior::logistic, 1e-4) * static_cast<double>(sigma));  // 9.21 sigma
}

Smoothing gaussian() {
  Smoothing smoothing;
  smoothing.noise = Noise::triangle;
  smoothing.composition = Composition::barrier;
  smoothing.gamma = 1e-2F;
  return smoothing;
}

Smoothing softras() {
  Smoothing smoothing = gaussian();
  smoothing.occupancy_prior = Prior::logistic;
  smoothing.depth_prior = Prior::gumbel;
  smoothing.blur_radius = published_blur_radius(smoothing.sigma);
  return smoothing;
}

Smoothing published(Prior prior) {
  Smoothing smoothing = gaussian();
  smoothing.occupancy_prior = smoothing.depth_prior = prior;
  smoothing.occupancy_estimator = smoothing.aggregation_estimator = Estimator::monte_carlo;
  smoothing.samples = 8;
  smoothing.variance_reduction = VarianceReduction::rigid;
  smoothing.blur_radius = published_blur_radius(smoothing.sigma);
  return smoothing;
}

Smoothing joint_gaussian() {
  Smoothing smoothing = gaussian();
  smoothing.composition = Composition::joint;
  return smoothing;
}

/// Rigid depths under uniform noise on the distances.
Smoothing uniform_edges(float sigma) {
  Smoothing smoothing = rigid_smoothing();
  smoothing.occupancy_prior = Prior::uniform;
  smoothing.distance = DistanceMetric::euclidean;
  smoothing.occupancy_width = OccupancyWidth::fixed;
  smoothing.sigma = sigma;
  smoothing.blur_radius.reset();
  return smoothing;
}

Smoothing opendr(int width, int height) {
  return uniform_edges(2.0F / static_cast<float>(std::min(width, height)));  // a pixel
}

Smoothing nmr() {
  constexpr float k_published_epsilon = 1e-3F, k_reach = 0.5F;  // NDC
  Smoothing smoothing = uniform_edges(k_published_epsilon);
  smoothing.occupancy_width = OccupancyWidth::variable;
  smoothing.blur_radius = k_reach;
  return smoothing;
}

struct Preset {
  std::string_view name;
  Smoothing (*make)(int width, int height);
};

constexpr std::array<Preset, 9> k_presets{
    {{"softras", [](int, int) { return softras(); }},
     {"opendr", opendr},
     {"nmr", [](int, int) { return nmr(); }},
     {"paper_gaussian", [](int, int) { return published(Prior::gaussian); }},
     {"paper_cauchy", [](int, int) { return published(Prior::cauchy); }},
     {"gaussian", [](int, int) { return gaussian(); }},
     {"joint_gaussian", [](int, int) { return joint_gaussian(); }},
     {"pixel", [](int, int) { return Smoothing{}; }},
     {"rigid", [](int, int) { return rigid_smoothing(); }}}};

const Preset& find_preset(std::string_view name, std::string_view where) {
  const auto* const preset = std::ranges::find(k_presets, name, &Preset::name);
  if (preset != k_presets.end()) return *preset;
  throw InvalidArgument(std::string(where), "\"" + std::string(name) + "\"",
                        one_of(smoothing_preset_names()));
}

}  // namespace

Smoothing rigid_smoothing() {
  Smoothing smoothing = gaussian();
  smoothing.composition = Composition::joint;
  smoothing.occupancy_width = OccupancyWidth::zero;
  smoothing.sigma = 1e-12F;  // has no part in it
  smoothing.gamma = 1e-9F;   // far below the spacing of single-precision depths: the nearest triangle wins
  smoothing.blur_radius = 0.0F;
  return smoothing;
}

Smoothing smoothing_preset(std::string_view name, int width, int height) {
  if (width < 1 || height < 1) {
    throw InvalidArgument("size (preset)", checks::text(width) + "x" + checks::text(height), "at least 1x1");
  }
  return find_preset(name, "preset (smoothing)").make(width, height);
}

std::vector<std::string_view> smoothing_preset_names() {
  std::vector<std::string_view> names;
  for (const Preset& preset : k_presets) names.push_back(preset.name);
  return names;
}

void require_preset(std::string_view name, std::string_view where) { find_preset(name, where); }

}  // namespace dpr
