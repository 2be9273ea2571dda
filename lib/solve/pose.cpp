// Gradient descent on an object's rotation and translation.
#include "dpr/pose.hpp"

#include <array>
#include <chrono>
#include <cmath>
#include <glm/gtc/constants.hpp>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <variant>

#include "dpr/error.hpp"
#include "dpr/renderer.hpp"
#include "solve/is_sampled.hpp"
#include "solve/polar.hpp"
#include "solve/require.hpp"

namespace dpr {
namespace {

std::string size_text(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

void require_rotation(const glm::dmat3& rotation) {
  constexpr double k_tolerance = 1e-3;  // what the rounding of a matrix written with a few digits leaves
  const glm::dmat3 excess = glm::transpose(rotation) * rotation - glm::dmat3(1.0);
  double error = 0;
  for (int c = 0; c < 3; ++c) error += glm::dot(excess[c], excess[c]);
  require(std::sqrt(error) < k_tolerance && glm::determinant(rotation) > 0, "initial rotation (pose)",
          std::sqrt(error), "an orthonormal matrix with determinant 1 (shown: |R^T R - 1|)");
}

/// The loss and its gradient as functions of the pose.
class Objective {
 public:
  Objective(const Device& device, const Scene& scene, const Image& target, LossWeights weights,
            const glm::dmat3& stretch)
      : renderer_(device),
        loss_(device, weights, {&target, 1}),
        stretch_(stretch),
        smoothing_(scene.smoothing),
        view_{scene.camera, {scene.meshes.front().transform}} {
    renderer_.set_scene(scene);
  }

  double evaluate(const Pose& pose, unsigned iteration) {
    view_.transforms.front() = affine(pose.rotation * stretch_, pose.translation);
    renderer_.set_views({&view_, 1});

    // Fresh noise in every iteration: its errors average out along the descent instead of adding up to a
    // bias.
    if (is_sampled(smoothing_)) {
      Smoothing fresh = smoothing_;
      fresh.seed += iteration;
      renderer_.set_smoothing(fresh);
    }
    renderer_.forward();
    const double loss = loss_.evaluate(renderer_);
    const std::string where = "loss (pose, iteration " + std::to_string(iteration) + ")";
    require(std::isfinite(loss), where.c_str(), loss, "a finite number");
    return loss;
  }

  SceneGradient gradient() { return renderer_.backward(loss_); }

  void set_smoothing(const Smoothing& smoothing) {
    smoothing_ = smoothing;
    renderer_.set_smoothing(smoothing);
  }

 private:
  Renderer renderer_;
  ImageLoss loss_;
  glm::dmat3 stretch_;
  Smoothing smoothing_;
  View view_;
};

/// One step of the optimizer in the tangent space at the pose: R <- exp([delta]x) R, t <- t + delta.
void descend(Pose& pose, Optimizer& optimizer, const PoseGradient& gradient, bool with_translation) {
  const auto& [r, t] = gradient;
  const std::array<double, 6> flat{r.x, r.y, r.z, t.x, t.y, t.z};
  const auto step = optimizer.step(std::span(flat).first(with_translation ? 6 : 3));
  const glm::dmat3 turned = rotation_from_vector({step[0], step[1], step[2]}) * pose.rotation;
  pose.rotation = polar_decomposition(turned).rotation;  // keeps rounding errors from adding up
  if (with_translation) pose.translation += glm::dvec3(step[3], step[4], step[5]);
}

/// The schedule at work: changes smoothing and learning rate between two iterations.
class Schedule {
 public:
  explicit Schedule(const PoseOptions& options, const Smoothing& start) {
    if (const auto* anneal = std::get_if<AnnealSchedule>(&options.schedule)) {
      annealed_.emplace(*anneal, options.iterations, start, options.optimizer.learning_rate);
    } else {
      adaptive_.emplace(std::get<AdaptiveSchedule>(options.schedule));
    }
  }

  /// True if the smoothing changed.
  bool update(unsigned iteration, double grad_gamma, Smoothing& smoothing, Optimizer& optimizer) {
    double learning_rate = optimizer.learning_rate();
    if (annealed_ ? !annealed_->update(iteration, smoothing, learning_rate)
                  : !adaptive_->update(iteration, grad_gamma, smoothing, learning_rate)) {
      return false;
    }
    optimizer.set_learning_rate(learning_rate);
    if (adaptive_) optimizer.restart();  // as published; annealing's steps are too small to need it
    return true;
  }

 private:
  std::optional<AnnealedSmoothing> annealed_;
  std::optional<AdaptiveSmoothing> adaptive_;
};

/// Where a descent starts: the initial pose, then that pose turned by a fixed angle about axes spread evenly
/// over the sphere (a Fibonacci lattice).
Pose restart_pose(const Pose& initial, unsigned descent) {
  if (descent == 0) return initial;
  constexpr double k_turn_degrees = 60;  // out of the valley, not out of the neighbourhood
  constexpr double k_lattice_points = 8;
  const double golden_angle = glm::pi<double>() * (3 - std::sqrt(5.0));
  const double height = 1 - 2 * (std::fmod(descent - 1, k_lattice_points) + 0.5) / k_lattice_points;
  const double radius = std::sqrt(1 - height * height), angle = golden_angle * descent;
  const glm::dvec3 axis(radius * std::cos(angle), height, radius * std::sin(angle));
  return {rotation_from_vector(glm::radians(k_turn_degrees) * axis) * initial.rotation, initial.translation};
}

/// What one descent found: the best pose of its last smoothing level.
struct Descent {
  Pose pose;
  Smoothing smoothing;
  bool stopped = false;  // by the callback
};

Descent descend_from(Objective& objective, const PoseOptions& options, Pose pose, const Smoothing& start,
                     unsigned descent, const PoseSolver::Callback& callback,
                     std::vector<PoseIteration>& history) {
  Optimizer optimizer(options.optimizer);
  Schedule schedule(options, start);
  Descent best{pose, start};
  objective.set_smoothing(start);
  double best_loss = 0;
  for (unsigned i = 0; i < options.iterations; ++i) {
    const Smoothing& smoothing = best.smoothing;
    const double loss = objective.evaluate(pose, i);
    if (i == 0 || loss < best_loss) std::tie(best.pose, best_loss) = std::tie(pose, loss);
    history.push_back({static_cast<unsigned>(history.size()), descent, loss, smoothing.sigma, smoothing.gamma,
                       smoothing.samples, pose});
    if (callback && !callback(history.back())) {
      best.stopped = true;
      break;
    }
    const SceneGradient gradient = objective.gradient();
    descend(pose, optimizer, gradient.views.front().transforms.front(), options.solve_translation);
    if (schedule.update(i, gradient.gamma, best.smoothing, optimizer)) {
      objective.set_smoothing(best.smoothing);
      best_loss = objective.evaluate(best.pose, i);  // its loss so far is of another level
    }
  }
  return best;
}

}  // namespace

PoseSolver::PoseSolver(Device device, Scene scene, const Image& target, PoseOptions options)
    : device_(std::move(device)), scene_(std::move(scene)), target_(target), options_(options) {
  require(scene_.meshes.size() == 1, "number of meshes (pose)", scene_.meshes.size(), "1");
  validate(scene_);
  if (target_.width != scene_.width || target_.height != scene_.height) {
    throw InvalidArgument("size of the target (pose)", size_text(target_.width, target_.height),
                          size_text(scene_.width, scene_.height) + ", the scene's");
  }
  require(options_.iterations > 0, "iterations (pose)", options_.iterations, "at least 1");
  require(options_.explained > 0 && options_.explained < 1, "explained (pose)", options_.explained,
          "a number in (0, 1)");
  // Each throws what is wrong with its options.
  [[maybe_unused]] const Optimizer optimizer(options_.optimizer);
  [[maybe_unused]] const Schedule schedule(options_, scene_.smoothing);

  const glm::dmat3 linear(scene_.meshes.front().transform);
  require(std::abs(glm::determinant(linear)) > 0, "determinant of the transform (pose)",
          glm::determinant(linear), "a value other than 0");
  stretch_ = polar_decomposition(linear).stretch;

  // Nothing is computed that no step needs; the smoothing's gradient only feeds the schedule.
  scene_.gradients = {.positions = false,
                      .colors = false,
                      .transform = true,
                      .camera = false,
                      .lights = false,
                      .smoothing = std::holds_alternative<AdaptiveSchedule>(options_.schedule),
                      .background = false};
}

Pose PoseSolver::scene_pose() const {
  const glm::dmat4 transform(scene_.meshes.front().transform);
  return {polar_decomposition(glm::dmat3(transform)).rotation, glm::dvec3(transform[3])};
}

PoseResult PoseSolver::solve(const Pose& initial, const Callback& callback) const {
  require_rotation(initial.rotation);
  const auto start = std::chrono::steady_clock::now();
  Objective objective(device_, scene_, target_, options_.loss, stretch_);
  const Pose first{polar_decomposition(initial.rotation).rotation, initial.translation};

  PoseResult result;
  Smoothing finest = scene_.smoothing;
  double enough = 0;
  for (unsigned descent = 0; descent <= options_.restarts; ++descent) {
    const Descent found = descend_from(objective, options_, restart_pose(first, descent), scene_.smoothing,
                                       descent, callback, result.history);
    // Descents may end at different levels: they are compared at that of the first.
    if (descent == 0) finest = found.smoothing;
    objective.set_smoothing(finest);
    const double loss = objective.evaluate(found.pose, 0);
    if (descent == 0) enough = options_.explained * objective.evaluate(first, 0);
    if (descent == 0 || loss < result.loss) {
      std::tie(result.pose, result.loss, result.descent) = std::tie(found.pose, loss, descent);
    }
    result.explained = result.loss <= enough;
    if (found.stopped || result.explained) break;
  }
  result.iterations = static_cast<unsigned>(result.history.size());
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace dpr
