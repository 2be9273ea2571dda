// Gradient descent on an object's rotation and translation.
#include "solve/pose_descent.hpp"

#include <array>
#include <cmath>
#include <glm/gtc/constants.hpp>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "base/checks.hpp"
#include "dpr/renderer.hpp"
#include "dpr/subdivision.hpp"
#include "scene/gradient_table.hpp"
#include "solve/by_smoothing.hpp"
#include "solve/polar.hpp"
#include "solve/pose_space.hpp"

namespace dpr {
namespace {

/// The loss and its gradient as functions of the pose.
class Objective {
 public:
  Objective(const Device& device, const Scene& scene, const Image& target, const PoseBody& body,
            LossWeights weights)
      : renderer_(device),
        loss_(device, weights, {&target, 1}),
        body_(body),
        smoothing_(scene.smoothing),
        view_{scene.camera, body.transforms(body.pose())} {
    renderer_.set_scene(scene);
  }

  double evaluate(const Pose& pose, unsigned iteration) {
    view_.transforms = body_.transforms(pose);
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
  PoseGradient by_pose(const SceneGradient& gradient, const Pose& pose) const {
    return body_.gradient(pose, gradient.views.front().transforms);
  }

  int width() const { return renderer_.scene().width; }
  int height() const { return renderer_.scene().height; }

  void set_smoothing(const Smoothing& smoothing) {
    smoothing_ = smoothing;
    renderer_.set_smoothing(smoothing);
  }

 private:
  Renderer renderer_;
  ImageLoss loss_;
  PoseBody body_;
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
  Schedule(const Descent& options, const Smoothing& start) {
    if (const auto* anneal = std::get_if<AnnealSchedule>(&options.schedule)) {
      annealed_.emplace(*anneal, options.iterations, start, options.optimizer.learning_rate);
    } else {
      adaptive_.emplace(std::get<AdaptiveSchedule>(options.schedule));
    }
  }

  /// True if the smoothing changed.
  bool update(unsigned iteration, double derivative, Smoothing& smoothing, Optimizer& optimizer) {
    double learning_rate = optimizer.learning_rate();
    if (annealed_ ? !annealed_->update(iteration, smoothing, learning_rate)
                  : !adaptive_->update(iteration, derivative, smoothing, learning_rate)) {
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

/// Start of a descent: the initial pose, then that pose turned by a fixed angle about axes spread evenly over
/// the sphere (a Fibonacci lattice).
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

/// Result of a descent: the best pose of its last smoothing level.
struct Found {
  Pose pose;
  Smoothing smoothing;
  bool stopped = false;  // by the callback
};

Found descend_from(Objective& objective, const Descent& options, bool with_translation, Pose pose,
                   const Smoothing& start, unsigned descent, const PoseSolver::Callback& callback,
                   std::vector<PoseIteration>& history) {
  Optimizer optimizer(options.optimizer);
  Schedule schedule(options, start);
  Found best{pose, start};
  objective.set_smoothing(start);
  double best_loss = 0;
  for (unsigned i = 0; i < options.iterations; ++i) {
    const Smoothing& smoothing = best.smoothing;
    const double loss = objective.evaluate(pose, i);
    if (i == 0 || loss < best_loss) std::tie(best.pose, best_loss) = std::tie(pose, loss);
    history.push_back({static_cast<unsigned>(history.size()), descent, loss, smoothing, objective.width(),
                       objective.height(), 1, pose});
    if (callback && !callback(history.back())) {
      best.stopped = true;
      break;
    }
    const SceneGradient gradient = objective.gradient();
    descend(pose, optimizer, objective.by_pose(gradient, pose), with_translation);
    const bool is_last = i + 1 == options.iterations;  // no level without an iteration
    if (!is_last && schedule.update(i, by_smoothing(best.smoothing, gradient), best.smoothing, optimizer)) {
      objective.set_smoothing(best.smoothing);
      best_loss = objective.evaluate(best.pose, i);  // its loss so far is of another level
    }
  }
  return best;
}

}  // namespace

void validate(const Descent& descent, const Scene& scene) {
  require(descent.iterations > 0, "iterations (pose)", descent.iterations, "at least 1");
  // Each throws what is wrong with its options.
  [[maybe_unused]] const Optimizer optimizer(descent.optimizer);
  [[maybe_unused]] const Schedule schedule(descent, scene.smoothing);
}

PoseResult descend_to_pose(const Device& device, Scene scene, const Image& target, const PoseOptions& options,
                           const Pose& initial, const PoseSolver::Callback& callback) {
  const auto& descent = std::get<Descent>(options.method);
  // Nothing is computed that no step needs; the smoothing's gradient only feeds the schedule.
  scene.gradients = no_gradients();
  scene.gradients.transform = true;
  scene.gradients.smoothing = std::holds_alternative<AdaptiveSchedule>(descent.schedule);
  const PoseSpace space(scene, initial, options);
  const std::vector<View> lenses = space.seen_through_lenses(scene.camera);
  Objective objective(device, subdivide_for_lens(scene, {}, lenses).scene, target, space.body(),
                      descent.loss);

  PoseResult result;
  result.start = initial;
  Smoothing finest = scene.smoothing;
  double enough = 0;
  for (unsigned i = 0; i <= descent.restarts; ++i) {
    const Found found = descend_from(objective, descent, options.solve_translation, restart_pose(initial, i),
                                     scene.smoothing, i, callback, result.history);
    // Descents may end at different levels: they are compared at that of the first.
    if (i == 0) finest = found.smoothing;
    objective.set_smoothing(finest);
    const double loss = objective.evaluate(found.pose, 0);
    if (i == 0) enough = static_cast<double>(options.explained) * objective.evaluate(initial, 0);
    if (i == 0 || loss < result.loss) {
      std::tie(result.pose, result.loss, result.descent) = std::tie(found.pose, loss, i);
    }
    result.explained = result.loss < enough;
    result.doubt = result.explained ? PoseDoubt::none : PoseDoubt::wrong_poses;
    if (enough > 0) result.unexplained_part = static_cast<double>(options.explained) * result.loss / enough;
    if (found.stopped || result.explained) break;
  }
  return result;
}

}  // namespace dpr
