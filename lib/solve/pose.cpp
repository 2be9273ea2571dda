// Gradient descent on an object's rotation and translation.
#include "dpr/pose.hpp"

#include <array>
#include <chrono>
#include <cmath>
#include <string>
#include <tuple>
#include <utility>

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
  // Each throws what is wrong with its options.
  [[maybe_unused]] const Optimizer optimizer(options_.optimizer);
  [[maybe_unused]] const AdaptiveSmoothing adaptive(options_.schedule);

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
                      .smoothing = options_.iterations > options_.schedule.start,
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
  Optimizer optimizer(options_.optimizer);
  AdaptiveSmoothing adaptive(options_.schedule);
  Smoothing smoothing = scene_.smoothing;
  double learning_rate = options_.optimizer.learning_rate;

  PoseResult best;
  Pose pose{polar_decomposition(initial.rotation).rotation, initial.translation};
  for (unsigned i = 0; i < options_.iterations; ++i) {
    const double loss = objective.evaluate(pose, i);
    if (i == 0 || loss < best.loss) std::tie(best.pose, best.loss) = std::tie(pose, loss);
    best.history.push_back({i, loss, smoothing.sigma, smoothing.gamma, smoothing.samples, pose});
    if (callback && !callback(best.history.back())) break;

    const SceneGradient gradient = objective.gradient();
    descend(pose, optimizer, gradient.views.front().transforms.front(), options_.solve_translation);
    if (adaptive.update(i, gradient.gamma, smoothing, learning_rate)) {
      objective.set_smoothing(smoothing);
      optimizer.set_learning_rate(learning_rate);
      optimizer.restart();
      best.loss = objective.evaluate(best.pose, i);  // its loss so far is of another level
    }
  }
  best.iterations = static_cast<unsigned>(best.history.size());
  best.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return best;
}

}  // namespace dpr
