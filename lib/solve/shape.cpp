// The shape solver: levels of resolution, each with smoothing that shrinks and a mesh that is made anew.
#include "dpr/shape.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <system_error>
#include <utility>

#include "base/checks.hpp"
#include "base/clock.hpp"
#include "dpr/adaptive_smoothing.hpp"
#include "dpr/multi_device.hpp"
#include "loss/image_loss_impl.hpp"
#include "loss/mesh_loss_impl.hpp"
#include "mesh/remesh.hpp"
#include "renderer/setter_checks.hpp"
#include "solve/by_smoothing.hpp"
#include "solve/large_steps.hpp"
#include "solve/rigidity.hpp"
#include "solve/shape_cameras.hpp"
#include "solve/shape_checks.hpp"
#include "solve/shape_explained.hpp"
#include "solve/shape_level.hpp"
#include "solve/shape_space.hpp"
#include "solve/shape_state.hpp"
#include "solve/visual_hull.hpp"

namespace dpr {
namespace {

std::vector<double> flat(const std::vector<glm::vec3>& list) {
  std::vector<double> values;
  values.reserve(3 * list.size());
  for (const glm::vec3& v : list) {
    for (int i = 0; i < 3; ++i) values.push_back(v[i]);
  }
  return values;
}

void add(std::vector<double>& values, std::span<const double> steps) {
  for (std::size_t i = 0; i < values.size(); ++i) values[i] += steps[i];
}

/// The smoothing with a blur that many times as wide, in the image as in depth.
Smoothing widened(Smoothing smoothing, double factor) {
  const double power = smoothing.distance == DistanceMetric::squared ? 2 : 1;
  const auto scale = static_cast<float>(std::pow(factor, power));
  set_sigma(smoothing, scale * smoothing.sigma);
  smoothing.gamma *= static_cast<float>(factor);
  return smoothing;
}

OptimizerOptions position_optimizer(const ShapeOptions& options, double radius) {
  const bool large = options.steps == ShapeSteps::large_steps;
  return {.kind = large ? OptimizerKind::uniform_adam : OptimizerKind::adam,
          .learning_rate = options.learning_rate * radius};
}

// Of a level, unless the options say so.
constexpr unsigned k_iterations = 160, k_iterations_from_hull = 100;

/// One run of the solver.
class Run {
 public:
  Run(const std::vector<Device>& devices, const ShapeViews& views, const Mesh& start,
      const ShapeOptions& options, ShapeState state)
      : views_(views),
        options_(options),
        common_(common_view(views)),
        finest_(finest_smoothing(views, options)),
        renderer_(devices),
        position_optimizer_(position_optimizer(options, common_.radius)),
        state_(std::move(state)) {
    position_optimizer_.set_state(state_.position_steps);
    if (options.color_learning_rate > 0) {
      color_optimizer_.emplace(OptimizerOptions{.learning_rate = options.color_learning_rate});
      color_optimizer_->set_state(state_.color_steps);
    }
    renderer_.set_chunk(options.chunk > 0 || devices.size() > 1 ? options.chunk : options.batch);
    if (options.rigidity > 0) rigidity_.emplace(start, static_cast<double>(options.rigidity));
    if (options.refine_cameras && state_.cameras.empty()) state_.cameras = unmoved_cameras(views);
  }

  /// One iteration; what it evaluated is the history's last.
  void iterate() {
    const unsigned level = state_.iteration / options_.iterations;
    const unsigned in_level = state_.iteration % options_.iterations;
    const bool is_new_level = !level_ || in_level == 0;
    if (is_new_level) {
      level_.emplace(views_, options_, level);
      level_->set_cameras(state_.cameras);
    }
    const bool remeshes = options_.remesh_interval > 0 && in_level % options_.remesh_interval == 0 &&
                          2 * in_level < options_.iterations;
    if (remeshes) make_mesh_anew(level);
    if (is_new_level || remeshes) prepare();
    if (is_new_level) {
      const ShapeTargets targets(views_, options_, *level_);
      renderer_.set_loss(targets.loss(), targets.images);
    }
    const double rate = std::pow(options_.learning_rate_end, progress(in_level));
    position_optimizer_.set_learning_rate(rate * options_.learning_rate * common_.radius);
    if (color_optimizer_) color_optimizer_->set_learning_rate(rate * options_.color_learning_rate);
    const SceneGradient gradient = evaluate(level, in_level);
    descend(gradient);
    const bool is_second_half = 2 * in_level >= options_.iterations;  // the shape is nearly there
    if (options_.refine_cameras && is_second_half)
      refine_cameras(gradient.views, in_level, rate * options_.camera_learning_rate);
    if (is_adaptive()) adapt(level, in_level, by_smoothing(finest_, gradient));
    ++state_.iteration;
  }

  /// How well the mesh explains every view, as it is now.
  std::vector<ViewExplanation> explain() {
    ShapeLevel level(views_, options_, options_.levels - 1);
    level.set_cameras(state_.cameras);
    renderer_.set_scene(scene_of_level(views_, level, state_.mesh(), finest_));
    renderer_.set_views(level.views);
    std::vector<Image> rendered = renderer_.render(), shown(rendered.size());
    for (std::size_t i = 0; i < shown.size(); ++i) shown[level.order[i]] = std::move(rendered[i]);
    return explain_views(views_, options_, shown);
  }

  /// With the optimizers' memories.
  const ShapeState& state() {
    state_.position_steps = position_optimizer_.state();
    if (color_optimizer_) state_.color_steps = color_optimizer_->state();
    return state_;
  }

 private:
  void make_mesh_anew(unsigned level) {
    const double edge =
        static_cast<double>(options_.edge_pixels) * common_.pixel * pixel_scale(options_, level);
    const std::optional<Mesh> mesh = remesh(state_.mesh(), static_cast<float>(edge));
    if (!mesh || mesh->faces.empty()) return;  // soup keeps its faces
    state_.faces = mesh->faces;
    state_.positions = flat(mesh->positions);
    state_.colors = flat(mesh->vertex_colors);
    position_optimizer_.restart();
    if (color_optimizer_) color_optimizer_->restart();
  }

  MeshLossWeights scaled_regularizers() const {
    MeshLossWeights weights = options_.regularizers;
    const auto radius = static_cast<float>(common_.radius);
    weights.laplacian /= radius * radius;
    weights.edge_length /= radius * radius;
    weights.edge_target *= radius;
    return weights;
  }

  /// Makes the current mesh the scene.
  void prepare() {
    const Mesh mesh = state_.mesh();
    steps_.emplace(mesh, options_.lambda);
    Scene scene = scene_of_level(views_, *level_, mesh, finest_);
    scene.gradients.positions = true;
    scene.gradients.colors = color_optimizer_.has_value();
    scene.gradients.smoothing = is_adaptive();
    scene.gradients.camera = options_.refine_cameras;
    renderer_.set_scene(scene);
    renderer_.set_views(level_->views);
    renderer_.set_mesh_loss(scaled_regularizers());
  }

  /// Through a level, from 0 to 1.
  double progress(unsigned in_level) const {
    return static_cast<double>(in_level) / std::max(options_.iterations - 1, 1U);
  }

  bool is_adaptive() const { return options_.schedule == ShapeSchedule::adaptive; }

  /// A level's, somewhere between its beginning (0) and its end (1).
  Smoothing annealed(unsigned level, double fraction) const {
    const double begin = static_cast<double>(options_.blur) / static_cast<double>(options_.blur_end);
    return widened(finest_, pixel_scale(options_, level) * std::pow(begin, 1 - fraction));
  }

  Smoothing smoothing_at(unsigned level, unsigned in_level) {
    Smoothing smoothing = annealed(level, progress(in_level));
    if (is_adaptive()) {
      ShapeState::Adaptive& now = state_.adaptive;
      if (in_level == 0) now = {smoothing.sigma, smoothing.gamma, smoothing.samples, now.average};
      smoothing = finest_;
      set_sigma(smoothing, now.sigma);
      smoothing.gamma = now.gamma;
      smoothing.samples = now.samples;
    }
    smoothing.seed += state_.iteration;  // fresh noise: its errors average out along the descent
    return smoothing;
  }

  /// The published rate, at moments enough to come to the level's end. Learning rates fall by themselves.
  void adapt(unsigned level, unsigned in_level, double derivative) {
    constexpr unsigned k_settling = 10, k_moments = 40;  // parts of a level
    const Smoothing end = annealed(level, 1);
    AdaptiveSmoothing schedule({.start = options_.iterations / k_settling,
                                .interval = std::max(options_.iterations / k_moments, 1U),
                                .sigma_floor = end.sigma,
                                .gamma_floor = end.gamma,
                                .learning_rate_divisor = 1},
                               state_.adaptive.average);
    Smoothing smoothing = state_.history.back().smoothing;
    double learning_rate = options_.learning_rate;
    schedule.update(in_level, derivative, smoothing, learning_rate);
    state_.adaptive = {smoothing.sigma, smoothing.gamma, smoothing.samples, schedule.average()};
  }

  SceneGradient evaluate(unsigned level, unsigned in_level) {
    const Mesh mesh = state_.mesh();
    ShapeIteration step;
    step.iteration = state_.iteration;
    step.level = level;
    step.smoothing = smoothing_at(level, in_level);
    renderer_.set_positions(0, mesh.positions);
    renderer_.set_colors(0, mesh.vertex_colors);
    renderer_.set_smoothing(step.smoothing);
    const auto [first, count] = level_->batch(in_level);
    MultiDeviceRenderer::Evaluation found = renderer_.evaluate(first, count);
    step.image_loss = found.loss;
    step.mesh_loss = found.mesh_loss;
    if (rigidity_) step.mesh_loss += rigidity_->evaluate(state_.positions, rigidity_gradient_);
    step.loss = step.image_loss + step.mesh_loss;
    const std::string where = "loss (shape, iteration " + std::to_string(step.iteration) + ")";
    require(std::isfinite(step.loss), where.c_str(), step.loss, "a finite number");
    step.width = level_->width;
    step.height = level_->height;
    step.vertices = mesh.positions.size();
    step.faces = mesh.faces.size();
    step.notes = renderer_.take_notes();
    state_.history.push_back(std::move(step));
    return std::move(found.gradient);
  }

  void descend(const SceneGradient& gradient) {
    const MeshGradient& grad = gradient.meshes.front();
    std::vector<double> grad_positions = flat(grad.positions);
    if (rigidity_) add(grad_positions, rigidity_gradient_);
    if (options_.steps == ShapeSteps::large_steps) {
      // v = (I + lambda L)^-1 u: the gradient for u, and what a step of u does to v.
      const auto step = position_optimizer_.step(steps_->solve(grad_positions));
      add(state_.positions, steps_->solve(step));
    } else {
      add(state_.positions, position_optimizer_.step(grad_positions));
    }
    if (color_optimizer_) add(state_.colors, color_optimizer_->step(flat(grad.colors)));
  }

  void refine_cameras(std::span<const ViewGradient> gradients, unsigned in_level, double learning_rate) {
    const auto [first, count] = level_->batch(in_level);
    move_cameras(gradients, std::span(level_->order).subspan(first, count), common_, learning_rate,
                 state_.cameras);
    if (in_level + 1 == options_.iterations) anchor(views_, common_, state_.cameras, state_.positions);
    level_->set_cameras(state_.cameras);
    renderer_.set_views(level_->views);
  }

  const ShapeViews& views_;
  const ShapeOptions& options_;
  CommonView common_;
  Smoothing finest_;
  MultiDeviceRenderer renderer_;
  Optimizer position_optimizer_;
  std::optional<Optimizer> color_optimizer_;  // none: the colours stay
  std::optional<ShapeLevel> level_;
  std::optional<LargeSteps> steps_;  // of the current mesh
  std::optional<Rigidity> rigidity_;
  std::vector<double> rigidity_gradient_;  // at the last positions
  ShapeState state_;
};

Mesh make_sphere(const CommonView& common) {
  constexpr unsigned k_subdivisions = 3;
  Mesh sphere = make_icosphere(k_subdivisions, static_cast<float>(common.radius));
  for (glm::vec3& p : sphere.positions) p += glm::vec3(common.centre);
  return sphere;
}

}  // namespace

Smoothing finest_smoothing(const ShapeViews& views, const ShapeOptions& options) {
  if (views.smoothing) return *views.smoothing;
  const CommonView common = common_view(views);
  const double blur = static_cast<double>(options.blur_end);
  const double ndc = blur * 2.0 / std::min(views.width, views.height);
  Smoothing smoothing = smoothing_preset("pixel");  // nearest, in the least time (dpr_experiments shapes)
  smoothing.sigma = static_cast<float>(ndc * ndc);
  smoothing.gamma = static_cast<float>(blur * common.pixel / common.depth_range);
  return smoothing;
}

ShapeSolver::ShapeSolver(Device device, ShapeViews views, ShapeOptions options)
    : ShapeSolver(std::vector{std::move(device)}, std::move(views), options) {}

ShapeSolver::ShapeSolver(std::vector<Device> devices, ShapeViews views, ShapeOptions options)
    : devices_(std::move(devices)), views_(std::move(views)), options_(options) {
  check_devices(devices_);
  check_shape_views(views_);
  check_shape_options(options_, views_);
  std::optional<Mesh> start = views_.initial;
  if (!start) {
    start = visual_hull(views_);
    begins_with_hull_ = start.has_value();
  }
  if (options_.iterations == 0)
    options_.iterations = begins_with_hull_ ? k_iterations_from_hull : k_iterations;
  start_ = with_vertex_colors(start ? *start : make_sphere(common_view(views_)));
  check_mesh_loss(options_.regularizers, start_);
  const ShapeTargets targets(views_, options_, ShapeLevel(views_, options_, 0));
  check_loss(targets.loss(), targets.images);
}

unsigned ShapeSolver::most_iterations() const { return options_.levels * options_.iterations; }

ShapeResult ShapeSolver::solve(const Callback& callback, const std::filesystem::path& checkpoint) const {
  const auto start = Clock::now();
  ShapeState state;
  state.faces = start_.faces;
  state.positions = flat(start_.positions);
  state.colors = flat(start_.vertex_colors);
  const std::uint64_t mark = checkpoint.empty() ? 0 : fingerprint(views_, start_, options_);
  std::error_code unknown;  // then reading it says why
  if (!checkpoint.empty() && (std::filesystem::exists(checkpoint, unknown) || unknown))
    state = read_checkpoint(checkpoint, mark, finest_smoothing(views_, options_),
                            options_.refine_cameras ? views_.views.size() : 0);

  Run run(devices_, views_, start_, options_, std::move(state));
  bool goes_on = true;
  while (goes_on && run.state().iteration < most_iterations()) {
    run.iterate();
    const ShapeState& now = run.state();
    goes_on = !callback || callback(now.history.back(), now.mesh());
    const bool is_due = now.iteration % options_.checkpoint_interval == 0 || !goes_on;
    if (!checkpoint.empty() && (is_due || now.iteration == most_iterations()))
      write_checkpoint(checkpoint, now, mark);
  }
  const ShapeState& end = run.state();
  return {start_,
          end.mesh(),
          end.iteration == most_iterations(),
          seconds_since(start),
          end.history,
          moved_cameras(views_, end.cameras),
          run.explain()};
}

}  // namespace dpr
