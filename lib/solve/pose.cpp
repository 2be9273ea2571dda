// The pose solver's public face: checks what it is given and hands it to a method.
#include "dpr/pose.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <variant>

#include "base/checks.hpp"
#include "base/clock.hpp"
#include "dpr/error.hpp"
#include "scene/see_through.hpp"
#include "solve/polar.hpp"
#include "solve/pose_body.hpp"
#include "solve/pose_descent.hpp"
#include "solve/pose_problem.hpp"
#include "solve/pose_pyramid.hpp"
#include "solve/pose_fit.hpp"

namespace dpr {
namespace {

void require_initial(const Pose& pose) {
  constexpr double k_tolerance = 1e-3;  // what the rounding of a matrix written with a few digits leaves
  const glm::dmat3& rotation = pose.rotation;
  const glm::dmat3 excess = glm::transpose(rotation) * rotation - glm::dmat3(1.0);
  double error = 0;
  for (int c = 0; c < 3; ++c) error += glm::dot(excess[c], excess[c]);
  require(std::sqrt(error) < k_tolerance && glm::determinant(rotation) > 0, "initial rotation (pose)",
          std::sqrt(error), "an orthonormal matrix with determinant 1 (shown: |R^T R - 1|)");
  checks::require_finite(glm::vec3(pose.translation), "initial translation (pose)");
}

void validate_meshes(const Scene& scene, const std::vector<std::size_t>& meshes) {
  const std::size_t count = scene.meshes.size();
  if (meshes.empty())
    require(count == 1, "number of meshes (pose)", count, "1, or a list of those that move");
  for (const std::size_t mesh : meshes) {
    if (mesh >= count) {
      throw InvalidArgument("meshes (pose)", std::to_string(mesh),
                            "numbers of the scene's meshes, below " + std::to_string(count));
    }
    if (std::ranges::count(meshes, mesh) > 1)
      throw InvalidArgument("meshes (pose)", std::to_string(mesh) + " twice", "each once");
  }
}

const LeastSquares& require_least_squares(const PoseOptions& options, const char* wanted) {
  const auto* method = std::get_if<LeastSquares>(&options.method);
  if (method == nullptr) throw InvalidArgument(wanted, "a descent", "least squares");
  return *method;
}

template <typename Work>
PoseResult timed(const Work& work) {
  const auto start = Clock::now();
  PoseResult result = work();
  result.iterations = static_cast<unsigned>(result.history.size());
  result.seconds = seconds_since(start);
  return result;
}

}  // namespace

PoseSolver::PoseSolver(Device device, Scene scene, const Image& target, PoseOptions options)
    : device_(std::move(device)), scene_(std::move(scene)), target_(target), options_(std::move(options)) {
  validate_meshes(scene_, options_.meshes);
  validate(scene_);
  require_opaque(scene_, "pose");
  const auto* least_squares = std::get_if<LeastSquares>(&options_.method);
  if (!target_.pixels.empty() || least_squares == nullptr || !has_observations(*least_squares) ||
      least_squares->unknown_background) {
    require_size(target_, scene_, "target");
    checks::require_pixels(target_, "target (pose)");
  }
  require(options_.explained > 0 && options_.explained < 1, "explained (pose)", options_.explained,
          "a number in (0, 1)");
  if (options_.solve_focal) require_least_squares(options_, "focal length (pose)");
  if (options_.solve_distortion) {
    require_least_squares(options_, "distortion (pose)");
    if (scene_.camera.orthographic_height)
      throw InvalidArgument("distortion (pose)", "an orthographic camera", "a perspective one, with a lens");
  }
  if (options_.solve_translation && scene_.camera.orthographic_height) {
    throw InvalidArgument("translation (pose)", "an orthographic camera, which shows nothing of the depth",
                          "a perspective one, or a rotation to look for alone");
  }
  std::visit([&](const auto& method) { validate(method, scene_); }, options_.method);
  const bool stands = scene_.meshes.size() > std::max<std::size_t>(1, options_.meshes.size());
  if (stands && least_squares != nullptr && !least_squares->silhouette.image.pixels.empty()) {
    throw InvalidArgument("silhouette (pose)", "one in a scene where meshes stand still",
                          "colours or depths, which show these too");
  }
  const std::size_t first = options_.meshes.empty() ? 0 : options_.meshes.front();
  const double determinant = glm::determinant(glm::dmat3(scene_.meshes[first].transform));
  require(std::abs(determinant) > 0, "determinant of the transform (pose)", determinant,
          "a value other than 0");
}

PoseSolver PoseSolver::of_views(Device device, const Scene& scene, const std::vector<PoseView>& views,
                                const PoseOptions& options) {
  require_views(views, options);
  const auto solver_of = [&](std::size_t i) {
    PoseProblem problem = problem_of(views[i], scene, options);
    try {
      return PoseSolver(device, std::move(problem.scene), problem.target, std::move(problem.options));
    } catch (const InvalidArgument& e) {
      throw InvalidArgument(checks::element("views", i) + ": " + e.argument(), e.got(), e.expected());
    }
  };
  PoseSolver solver = solver_of(0);
  for (std::size_t i = 1; i < views.size(); ++i) {
    solver_of(i);
    solver.others_.push_back(views[i]);
  }
  return solver;
}

std::vector<PoseProblem> PoseSolver::problems() const {
  std::vector<PoseProblem> all{{scene_, target_, options_}};
  for (const PoseView& view : others_) all.push_back(problem_of(view, scene_, options_));
  return all;
}

Pose PoseSolver::scene_pose() const { return PoseBody(scene_, options_.meshes).pose(); }

unsigned PoseSolver::most_iterations() const {
  if (const auto* descent = std::get_if<Descent>(&options_.method)) return descent->iterations;
  return dpr::most_iterations(std::get<LeastSquares>(options_.method), scene_);
}

PoseResult PoseSolver::solve(const Pose& initial, const Callback& callback) const {
  if (std::holds_alternative<LeastSquares>(options_.method)) return solve(std::span(&initial, 1), callback);
  require_initial(initial);
  const Pose first{polar_decomposition(initial.rotation).rotation, initial.translation};
  return timed([&] { return descend_to_pose(device_, scene_, target_, options_, first, callback); });
}

PoseResult PoseSolver::solve(std::span<const Pose> initial, const Callback& callback) const {
  require_least_squares(options_, "initial poses (pose)");
  require(!initial.empty(), "initial poses (pose)", initial.size(), "at least one");
  std::vector<Pose> poses;
  for (const Pose& pose : initial) {
    require_initial(pose);
    poses.push_back({polar_decomposition(pose.rotation).rotation, pose.translation});
  }
  return timed([&] { return fit_pose(device_, problems(), poses, Foreknowledge::start, callback).result; });
}

PoseResult PoseSolver::search(const Callback& callback) const {
  const LeastSquares& method = require_least_squares(options_, "search (pose)");
  require(method.rotations > 0, "rotations (pose search)", method.rotations, "at least 1");
  const Pose pose = scene_pose();
  return timed([&] {
    return fit_pose(device_, problems(), std::span(&pose, 1), Foreknowledge::place, callback).result;
  });
}

}  // namespace dpr
