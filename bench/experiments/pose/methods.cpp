// Methods by name.
#include "experiments/pose/methods.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

#include "dpr/error.hpp"
#include "experiments/pose/protocol.hpp"

namespace dpr::bench {
namespace {

constexpr unsigned k_smoke_iterations = 3;

using Solve = PoseResult (*)(const PoseMethod& method, const Device& device, const Scene& scene,
                             const PoseProblemSet& set, const PoseProblem& problem, const Image& target,
                             bool smoke);

PoseResult solve_by_least_squares(const PoseMethod& name, const Device& device, const Scene& scene,
                                  const PoseProblemSet& set, const PoseProblem& problem, const Image& target,
                                  bool) {
  LeastSquares method;
  if (name.name == "default_pixel") method.noise = Noise::pixel;
  method.robust = set.clutter || set.occluded > 0;
  const PoseSolver solver(device, scene, target,
                          {.method = method, .solve_translation = set.translation_error > 0});
  return set.initial_degrees > 0 || set.translation_error > 0 ? solver.solve(problem.initial)
                                                              : solver.search();
}

PoseResult solve_by_annealing(const PoseMethod&, const Device& device, const Scene& scene,
                              const PoseProblemSet& set, const PoseProblem& problem, const Image& target,
                              bool smoke) {
  Descent descent;
  if (smoke) descent.iterations = k_smoke_iterations;
  Scene smoothed = scene;
  smoothed.smoothing = smoothing_preset("joint_gaussian");
  const PoseSolver solver(device, smoothed, target,
                          {.method = descent, .solve_translation = set.translation_error > 0});
  return solver.solve(problem.initial);
}

/// The members of the family that the published protocol is run with.
Smoothing member(std::string_view name) {
  Smoothing smoothing = smoothing_preset("gaussian");
  if (name == "exact" || name == "perturbed_pose") return smoothing;
  if (name == "paper_gaussian_minus_one") return smoothing_preset("paper_gaussian");
  if (name == "pixel") {
    const Smoothing published = smoothing;
    smoothing = smoothing_preset("pixel");
    smoothing.sigma = published.sigma;
    smoothing.gamma = published.gamma;
    return smoothing;
  }
  if (!name.starts_with("joint")) return smoothing_preset(name);
  smoothing = smoothing_preset("joint_gaussian");
  if (name == "joint_logistic") smoothing.occupancy_prior = smoothing.depth_prior = Prior::logistic;
  if (name == "joint_cauchy") smoothing.occupancy_prior = smoothing.depth_prior = Prior::cauchy;
  return smoothing;
}

Protocol protocol_of(const PoseMethod& method, const PoseProblemSet& set, bool smoke) {
  if (set.translation_error > 0) {
    throw InvalidArgument("--translation-error (pose experiment)", "the method " + method.name,
                          "default or anneal: the published protocol only turns");
  }
  Protocol protocol{.smoothing = member(method.name)};
  if (!method.adaptive) protocol.schedule.reset();
  Smoothing& smoothing = protocol.smoothing;
  smoothing.seed = set.seed;
  smoothing.variance_reduction = method.variance_reduction;
  smoothing.samples = method.samples.value_or(smoothing.samples);
  if (method.sigma) set_sigma(smoothing, *method.sigma);
  if (method.gamma) smoothing.gamma = *method.gamma;
  if (method.name == "paper_gaussian_minus_one") protocol.sensitivity = SensitivityConstant::one;
  if (smoke) protocol.iterations = k_smoke_iterations;
  return protocol;
}

PoseResult solve_as_published(const PoseMethod& method, const Device& device, const Scene& scene,
                              const PoseProblemSet& set, const PoseProblem& problem, const Image& target,
                              bool smoke) {
  return descend_as_published(device, scene, target, protocol_of(method, set, smoke), problem.initial);
}

PoseResult solve_on_perturbed_pose(const PoseMethod& method, const Device& device, const Scene& scene,
                                   const PoseProblemSet& set, const PoseProblem& problem, const Image& target,
                                   bool smoke) {
  return descend_on_perturbed_pose(device, scene, target, protocol_of(method, set, smoke), problem.initial);
}

struct Known {
  MethodName name;
  Solve solve;
};

constexpr std::array k_methods{
    Known{{"default",
           "what users get: least squares, robust where the set hides or clutters something; it "
           "searches where the initial rotation is uniform"},
          solve_by_least_squares},
    Known{{"default_pixel", "the same with noise of the pixel"}, solve_by_least_squares},
    Known{{"softras", "the published protocol with this preset"}, solve_as_published},
    Known{{"paper_gaussian", "the same"}, solve_as_published},
    Known{{"paper_cauchy", "the same"}, solve_as_published},
    Known{{"paper_gaussian_minus_one", "the same with the published constant in the sensitivity"},
          solve_as_published},
    Known{{"exact", "the protocol with the exact Gaussian estimator"}, solve_as_published},
    Known{{"joint", "the protocol with the exact joint composition"}, solve_as_published},
    Known{{"pixel", "the protocol with exact noise of the pixel"}, solve_as_published},
    Known{{"joint_logistic", "the joint composition with logistic noise"}, solve_as_published},
    Known{{"joint_cauchy", "the same with Cauchy noise"}, solve_as_published},
    Known{{"perturbed_pose", "the protocol with noise on the rotation instead"}, solve_on_perturbed_pose},
    Known{{"anneal", "this library's descent: annealed smoothing, joint composition, restarts"},
          solve_by_annealing}};

}  // namespace

std::vector<MethodName> pose_method_names() {
  std::vector<MethodName> names;
  for (const Known& known : k_methods) names.push_back(known.name);
  return names;
}

std::string label(const PoseMethod& method) {
  std::string text = method.name;
  const auto add = [&](const char* format, double value) {
    char part[32];
    std::snprintf(part, sizeof part, format, value);
    text += part;
  };
  if (method.samples) add("-m%g", *method.samples);
  if (method.sigma) add("-sigma%g", static_cast<double>(*method.sigma));
  if (method.gamma) add("-gamma%g", static_cast<double>(*method.gamma));
  if (method.variance_reduction != VarianceReduction::rigid) {
    text += "-" + std::string(to_string(method.variance_reduction));
  }
  if (!method.adaptive) text += "-fixed";
  return text;
}

PoseResult solve_problem(const PoseMethod& method, const Device& device, const Scene& scene,
                         const PoseProblemSet& set, const PoseProblem& problem, const Image& target,
                         bool smoke) {
  const auto known = std::ranges::find(k_methods, method.name, [](const Known& k) { return k.name.name; });
  if (known == k_methods.end()) {
    std::string names;
    for (const Known& k : k_methods) names += (names.empty() ? "" : ", ") + std::string(k.name.name);
    throw InvalidArgument("--method (pose experiment)", "\"" + method.name + "\"", names);
  }
  return known->solve(method, device, scene, set, problem, target, smoke);
}

}  // namespace dpr::bench
