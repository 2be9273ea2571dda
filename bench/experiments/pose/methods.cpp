// Methods by name.
#include "experiments/pose/methods.hpp"

#include <algorithm>

#include "dpr/error.hpp"

namespace dpr::bench {
namespace {

/// One descent as published: MATHS of the paper's experiments, or Le Lidec et al. 2021, section 5.
Descent published_protocol() {
  Descent descent;
  descent.iterations = 800;
  descent.optimizer = {.learning_rate = 5e-2, .beta1 = 0.9, .beta2 = 0.999};
  descent.schedule = AdaptiveSchedule{};
  descent.restarts = 0;
  return descent;
}

Smoothing smoothing_of(std::string_view method) {
  if (method == "exact") return Smoothing{};
  if (method == "joint" || method == "anneal") return smoothing_preset("joint_gaussian");
  return smoothing_preset(method);
}

PoseResult solve_by_default(const Device& device, const Scene& scene, const PoseProblemSet& set,
                            const PoseProblem& problem, const Image& target) {
  constexpr float k_outlier = 0.1F;  // colour difference
  LeastSquares method;
  if (set.clutter || set.occluded > 0) method.robust = k_outlier;
  const PoseSolver solver(device, scene, target,
                          {.method = method, .solve_translation = set.translation_error > 0});
  return set.initial_degrees > 0 || set.translation_error > 0 ? solver.solve(problem.initial)
                                                              : solver.search();
}

}  // namespace

std::vector<std::string_view> pose_method_names() {
  return {"default", "softras", "paper_gaussian", "paper_cauchy", "exact", "joint", "anneal"};
}

PoseResult solve_problem(std::string_view method, const Device& device, const Scene& scene,
                         const PoseProblemSet& set, const PoseProblem& problem, const Image& target,
                         bool smoke) {
  constexpr unsigned k_smoke_iterations = 3;
  const auto names = pose_method_names();
  if (std::ranges::find(names, method) == names.end()) {
    throw InvalidArgument("--method (pose experiment)", "\"" + std::string(method) + "\"",
                          "default, softras, paper_gaussian, paper_cauchy, exact, joint or anneal");
  }
  if (method == "default") return solve_by_default(device, scene, set, problem, target);
  Descent descent = method == "anneal" ? Descent{} : published_protocol();
  if (smoke) descent.iterations = k_smoke_iterations;
  Scene smoothed = scene;
  smoothed.smoothing = smoothing_of(method);
  smoothed.smoothing.seed = set.seed;
  const PoseSolver solver(device, smoothed, target,
                          {.method = descent, .solve_translation = set.translation_error > 0});
  return solver.solve(problem.initial);
}

}  // namespace dpr::bench
