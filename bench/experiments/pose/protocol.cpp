// Adam, the adaptive schedule, and what they are applied to.
#include "experiments/pose/protocol.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>

#include "dpr/image_loss.hpp"
#include "dpr/optimizer.hpp"
#include "dpr/renderer.hpp"
#include "experiments/pose/perturbed_pose.hpp"

namespace dpr::bench {
namespace {

struct Evaluation {
  double loss;
  glm::dvec3 gradient;  // for a rotation on the left, world
};

/// A loss that is smooth in the rotation, and whose smoothing can shrink.
class Objective {
 public:
  virtual ~Objective() = default;
  virtual Evaluation evaluate(const Pose& pose, unsigned iteration) = 0;
  /// True if the smoothing changed, and the learning rate with it.
  virtual bool adapt(unsigned iteration, double& learning_rate) = 0;
};

View view_of(const Scene& scene, const Pose& pose) {
  glm::dmat4 transform(pose.rotation);
  transform[3] = glm::dvec4(pose.translation, 1);
  return {scene.camera, {glm::mat4(transform)}};
}

class PerturbedImage : public Objective {
 public:
  PerturbedImage(const Device& device, Scene scene, const Image& target, const Protocol& protocol)
      : renderer_(device),
        loss_(device, LossWeights::only(LossKind::mse), {&target, 1}),
        target_(target),
        smoothing_(protocol.smoothing),
        sensitivity_(protocol.sensitivity),
        schedule_(protocol.schedule.value_or(AdaptiveSchedule{})),
        adapts_(protocol.schedule.has_value()) {
    scene.smoothing = smoothing_;
    scene.gradients = {.positions = false,
                       .colors = false,
                       .transform = true,
                       .camera = false,
                       .lights = false,
                       .smoothing = adapts_,
                       .background = false};
    renderer_.set_scene(scene);
  }

  Evaluation evaluate(const Pose& pose, unsigned iteration) override {
    const View view = view_of(renderer_.scene(), pose);
    renderer_.set_views({&view, 1});
    Smoothing fresh = smoothing_;
    fresh.seed += iteration;
    renderer_.set_smoothing(fresh);
    renderer_.forward();
    const double loss = loss_.evaluate(renderer_);
    const SceneGradient gradient = renderer_.backward(loss_);
    gamma_ = gradient.gamma;
    if (sensitivity_ == SensitivityConstant::one) gamma_ += bias_of_one();
    return {loss, gradient.views.front().transforms.front().rotation};
  }

  bool adapt(unsigned iteration, double& learning_rate) override {
    return adapts_ && schedule_.update(iteration, gamma_, smoothing_, learning_rate);
  }

 private:
  /// Mean bias of 1 instead of d: (d - 1) / gamma times the sum over pixels of <dL/dw, w>, which is <dL/dR,
  /// R> over a black background.
  double bias_of_one() const {
    constexpr double k_slots = 51;
    const Image image = renderer_.image();
    double sum = 0;
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
      const glm::dvec3 color(image.pixels[i]), wanted(target_.pixels[i]);
      sum += 2 * glm::dot(color - wanted, color);
    }
    const double channels = 3 * static_cast<double>(image.pixels.size());
    return (k_slots - 1) / static_cast<double>(smoothing_.gamma) * sum / channels;
  }

  Renderer renderer_;
  ImageLoss loss_;
  Image target_;
  Smoothing smoothing_;
  SensitivityConstant sensitivity_;
  AdaptiveSmoothing schedule_;
  bool adapts_;
  double gamma_ = 0;  // dL/dgamma of the last evaluation
};

class PerturbedRotation : public Objective {
 public:
  PerturbedRotation(const Device& device, const Scene& scene, const Image& target, const Protocol& protocol)
      : scene_(scene),
        perturbed_(device, scene, target,
                   {.scale = scaled(k_first_scale), .samples = protocol.smoothing.samples}),
        seed_(protocol.smoothing.seed),
        schedule_(protocol.schedule) {}

  Evaluation evaluate(const Pose& pose, unsigned iteration) override {
    const PerturbedPoseResult result = perturbed_.evaluate(view_of(scene_, pose), seed_ + iteration);
    constexpr double k_memory = 0.9;
    average_ = k_memory * average_ + (1 - k_memory) * result.sensitivity;
    return {result.loss, result.gradient.mesh_rotation};
  }

  /// The published rule, with what belongs to distances and depths applied to the one scale.
  bool adapt(unsigned iteration, double& learning_rate) override {
    constexpr double k_least_scale = 0.01;  // radians: at the cube's rim a third of a pixel
    const bool due = schedule_ && iteration >= schedule_->start &&
                     (iteration - schedule_->start) % schedule_->interval == 0 && average_ > 0;
    if (!due || scale_ <= k_least_scale) return false;
    scale_ = std::max(scale_ / static_cast<double>(schedule_->rate), k_least_scale);
    perturbed_.set_scale(scaled(scale_));
    learning_rate = std::max(learning_rate / static_cast<double>(schedule_->learning_rate_divisor),
                             static_cast<double>(schedule_->learning_rate_floor));
    return true;
  }

 private:
  static constexpr double k_first_scale = 0.2;

  static PoseParameters scaled(double radians) { return {.mesh_rotation = glm::dvec3(radians)}; }

  Scene scene_;
  PerturbedPose perturbed_;
  std::uint64_t seed_;
  std::optional<AdaptiveSchedule> schedule_;
  double scale_ = k_first_scale, average_ = 0;
};

PoseResult descend(Objective& objective, const Protocol& protocol, const Pose& initial) {
  const auto begin = std::chrono::steady_clock::now();
  Optimizer optimizer({.learning_rate = 5e-2, .beta1 = 0.9, .beta2 = 0.999});
  double learning_rate = optimizer.learning_rate();
  PoseResult result;
  result.start = initial;
  glm::dvec3 r = vector_from_rotation(initial.rotation);
  for (unsigned i = 0; i < protocol.iterations; ++i) {
    const Pose pose{rotation_from_vector(r), initial.translation};
    const Evaluation now = objective.evaluate(pose, i);
    if (i == 0 || now.loss < result.loss) {
      result.pose = pose;
      result.loss = now.loss;
    }
    const glm::dvec3 gradient = rotation_vector_gradient(r, now.gradient);
    const auto step = optimizer.step(std::array{gradient.x, gradient.y, gradient.z});
    r += glm::dvec3(step[0], step[1], step[2]);
    if (objective.adapt(i, learning_rate)) {
      optimizer.set_learning_rate(learning_rate);
      optimizer.restart();
    }
  }
  result.iterations = protocol.iterations;
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

}  // namespace

glm::dvec3 rotation_vector_gradient(const glm::dvec3& r, const glm::dvec3& gradient) {
  const double angle = glm::length(r);
  // Below this the series' next terms are lost in rounding.
  constexpr double k_small = 1e-4;
  const double a = angle < k_small ? 0.5 : (1 - std::cos(angle)) / (angle * angle);
  const double b = angle < k_small ? 1.0 / 6 : (angle - std::sin(angle)) / (angle * angle * angle);
  // J = 1 + a [r]x + b [r]x^2, and [r]x^T = -[r]x.
  const glm::dvec3 turned = glm::cross(r, gradient);
  return gradient - a * turned + b * glm::cross(r, turned);
}

PoseResult descend_as_published(const Device& device, const Scene& scene, const Image& target,
                                const Protocol& protocol, const Pose& initial) {
  PerturbedImage objective(device, scene, target, protocol);
  return descend(objective, protocol, initial);
}

PoseResult descend_on_perturbed_pose(const Device& device, const Scene& scene, const Image& target,
                                     const Protocol& protocol, const Pose& initial) {
  PerturbedRotation objective(device, scene, target, protocol);
  return descend(objective, protocol, initial);
}

}  // namespace dpr::bench
