// Poses of an object that moves between pictures of one camera, and that camera.
#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <span>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "base/checks.hpp"
#include "base/clock.hpp"
#include "dpr/error.hpp"
#include "dpr/pose_views.hpp"
#include "solve/levenberg_marquardt.hpp"
#include "solve/pose_beam.hpp"
#include "solve/pose_pivot.hpp"
#include "solve/pose_pyramid.hpp"
#include "solve/pose_fit.hpp"

namespace dpr {
namespace {

constexpr Eigen::Index k_pose_size = 6, k_rotation_size = 3;

/// What the camera shares with all views.
struct SharedCamera {
  double focal_scale = 1;
  glm::dvec2 radial{0.0};
};

double difference(const SharedCamera& a, const SharedCamera& b) {
  const glm::dvec2 radial = glm::abs(a.radial - b.radial);
  return std::max({std::abs(std::log(a.focal_scale / b.focal_scale)), radial.x, radial.y});
}

/// A picture, and what was found in it.
struct MovingView {
  PoseProblem problem;
  Pose start;
  FittedPose fitted{};
  std::vector<PoseIteration> history{};
  double seconds = 0;

  const LeastSquares& method() const { return std::get<LeastSquares>(problem.options.method); }
  PoseResult& result() { return fitted.result; }
};

/// A view among those that are fitted together.
struct JointView {
  MovingView& view;
  PosePivot pivot;
  PoseSpace space;
  Hypothesis hypothesis;  // about the middle
  std::optional<PoseLevel> level{};
  NormalEquations equations{};

  JointView(MovingView& of, const SharedCamera& camera)
      : view(of),
        pivot(of.problem.scene, of.problem.options),
        space(pivot.scene(), pivot.to_middle(of.result().pose), of.problem.options),
        hypothesis{pivot.to_middle(of.result().pose), camera.focal_scale, camera.radial} {}

  void make_level(const Device& device, LevelShape shape, bool is_last);
};

void JointView::make_level(const Device& device, LevelShape shape, bool is_last) {
  const LeastSquares& method = view.method();
  const Image& target = view.problem.target;
  if (is_last) shape.samples = view.fitted.samples;
  level.emplace(device, LevelPicture{pivot.scene(), target, method}, space, shape, view.result().light,
                view.fitted.normals);
  level->weigh_observations({&hypothesis, 1});
  if (method.robust && !target.pixels.empty()) set_robust_scale(*level, method, {&hypothesis, 1});
  equations = level->linearize({&hypothesis, 1}).front();
}

/// The views' poses and their camera as one system: first each pose, then the camera. Poses turn and move along the
/// world's axes in covariances, along the camera's in steps.
class JointSystem {
 public:
  explicit JointSystem(std::vector<JointView>& views)
      : views_(views),
        of_view_(static_cast<Eigen::Index>(views.front().space.size())),
        of_pose_(views.front().view.problem.options.solve_translation ? k_pose_size : k_rotation_size),
        size_(of_pose_ * std::ssize(views) + of_view_ - of_pose_) {}

  /// Takes steps of all views until none gains anything. False if `report` stopped it.
  bool refine(unsigned iterations, const std::function<bool()>& report);
  /// Of a view's pose and the camera, in the world's axes, as PoseResult has it.
  std::vector<std::vector<double>> covariances();
  double loss() const;

 private:
  /// The place of a view's parameter among all.
  Eigen::Index place(Eigen::Index view, Eigen::Index parameter) const {
    return parameter < of_pose_ ? of_pose_ * view + parameter : size_ - of_view_ + parameter;
  }
  /// The sum of the views' matrices.
  template <typename Matrices>
  Eigen::MatrixXd assembled(const Matrices& matrix_of) const;
  std::optional<Eigen::VectorXd> step(double damping) const;
  PoseSpace::Step step_of(const Eigen::VectorXd& step, Eigen::Index view) const;

  std::vector<JointView>& views_;
  Eigen::Index of_view_, of_pose_, size_;
};

double JointSystem::loss() const {
  double sum = 0;
  for (const JointView& view : views_) sum += view.equations.loss;
  return sum;
}

template <typename Matrices>
Eigen::MatrixXd JointSystem::assembled(const Matrices& matrix_of) const {
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(size_, size_);
  for (Eigen::Index view = 0; view < std::ssize(views_); ++view) {
    const PoseSpace::Matrix& matrix = matrix_of(views_[static_cast<std::size_t>(view)]);
    for (Eigen::Index i = 0; i < of_view_; ++i) {
      for (Eigen::Index j = 0; j < of_view_; ++j)
        sum(place(view, i), place(view, j)) += matrix[static_cast<std::size_t>(i * of_view_ + j)];
    }
  }
  return sum;
}

std::optional<Eigen::VectorXd> JointSystem::step(double damping) const {
  Eigen::MatrixXd hessian = assembled([](const JointView& v) -> const auto& { return v.equations.hessian; });
  hessian.diagonal() *= 1 + damping;
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(size_);
  for (Eigen::Index view = 0; view < std::ssize(views_); ++view) {
    const PoseSpace::Step& own = views_[static_cast<std::size_t>(view)].equations.gradient;
    for (Eigen::Index i = 0; i < of_view_; ++i) gradient[place(view, i)] += own[static_cast<std::size_t>(i)];
  }
  const Eigen::LLT<Eigen::MatrixXd> factor(hessian);
  if (factor.info() != Eigen::Success) return std::nullopt;
  return -factor.solve(gradient);
}

PoseSpace::Step JointSystem::step_of(const Eigen::VectorXd& step, Eigen::Index view) const {
  PoseSpace::Step own{};
  for (Eigen::Index i = 0; i < of_view_; ++i) own[static_cast<std::size_t>(i)] = step[place(view, i)];
  return own;
}

bool JointSystem::refine(unsigned iterations, const std::function<bool()>& report) {
  double damping = k_first_damping;
  for (unsigned iteration = 0; iteration < iterations; ++iteration) {
    if (!report()) return false;
    std::optional<Eigen::VectorXd> all = step(damping);
    while (!all && damping < k_most_damping) all = step(damping *= k_damping_rise);
    if (!all) return true;
    double longest = 0;
    for (Eigen::Index i = 0; i < std::ssize(views_); ++i)
      longest = std::max(longest, views_[static_cast<std::size_t>(i)].space.length(step_of(*all, i)));
    if (longest < k_still_pixels * views_.front().level->pixel_ndc()) return true;
    if (longest > k_longest_step_ndc) *all *= k_longest_step_ndc / longest;
    std::vector<std::pair<Hypothesis, NormalEquations>> moved;
    double loss = 0;
    for (Eigen::Index i = 0; i < std::ssize(views_); ++i) {
      JointView& view = views_[static_cast<std::size_t>(i)];
      const Hypothesis hypothesis = view.space.moved(view.hypothesis, step_of(*all, i));
      moved.emplace_back(hypothesis, view.level->linearize({&hypothesis, 1}).front());
      loss += moved.back().second.loss;
    }
    if (!(loss < this->loss())) {
      if ((damping *= k_damping_rise) > k_most_damping) return true;
      continue;
    }
    damping = std::max(damping * k_damping_fall, k_least_damping);
    for (std::size_t i = 0; i < views_.size(); ++i)
      std::tie(views_[i].hypothesis, views_[i].equations) = moved[i];
  }
  return true;
}

std::vector<std::vector<double>> JointSystem::covariances() {
  for (JointView& view : views_) view.equations = view.level->judge(view.hypothesis);
  const Eigen::MatrixXd hessian =
      assembled([](const JointView& v) -> const auto& { return v.equations.hessian; });
  const Eigen::MatrixXd scatter =
      assembled([](const JointView& v) -> const auto& { return v.equations.scatter; });
  std::vector<std::vector<double>> result(views_.size());
  const Eigen::LLT<Eigen::MatrixXd> factor(hessian);
  if (factor.info() != Eigen::Success) return result;
  const Eigen::MatrixXd half = factor.solve(scatter), whole = factor.solve(half.transpose());
  for (Eigen::Index view = 0; view < std::ssize(views_); ++view) {
    std::vector<double> own;
    for (Eigen::Index i = 0; i < of_view_; ++i) {
      for (Eigen::Index j = 0; j < of_view_; ++j) own.push_back(whole(place(view, i), place(view, j)));
    }
    result[static_cast<std::size_t>(view)] = views_[static_cast<std::size_t>(view)].space.to_world(own);
  }
  return result;
}

class MovingFit {
 public:
  MovingFit(const Device& device, const Scene& scene, std::span<const PoseView> views,
            const PoseOptions& options, PoseStart start, const PoseSolver::Callback& callback);

  std::vector<PoseResult> run();

 private:
  void fit_alone(std::size_t view, const std::vector<Pose>& initial, Foreknowledge known);
  void fit_again(std::size_t view, bool is_near);
  void fit_together(const std::vector<std::size_t>& which, bool begins_coarse);
  std::vector<std::size_t> explained() const;
  bool report(std::size_t view, PoseIteration step);

  const Device& device_;
  bool finds_camera_;
  Foreknowledge known_;
  const PoseSolver::Callback& callback_;
  bool goes_on_ = true;
  SharedCamera camera_;
  std::vector<MovingView> views_;
};

MovingFit::MovingFit(const Device& device, const Scene& scene, std::span<const PoseView> views,
                     const PoseOptions& options, PoseStart start, const PoseSolver::Callback& callback)
    : device_(device),
      finds_camera_(options.solve_focal || options.solve_distortion),
      known_(start == PoseStart::unknown ? Foreknowledge::place : Foreknowledge::start),
      callback_(callback) {
  const PoseSolver checks_the_rest =
      PoseSolver::of_views(device, scene, {views.begin(), views.end()}, options);
  for (const PoseView& view : views) {
    views_.push_back({problem_of(view, scene, options), checks_the_rest.scene_pose()});
  }
}

std::vector<PoseResult> MovingFit::run() {
  constexpr unsigned k_most_rounds_together = 6;
  constexpr double k_same = 1e-3;  // of the focal length, and of the lens' coefficients
  for (std::size_t i = 0; i < views_.size(); ++i) fit_alone(i, {views_[i].start}, known_);
  std::vector<std::size_t> last;
  SharedCamera before;
  for (unsigned round = 0; finds_camera_ && goes_on_ && round < k_most_rounds_together; ++round) {
    std::vector<std::size_t> which = explained();
    if (which.empty()) {
      for (std::size_t i = 0; i < views_.size(); ++i) which.push_back(i);
    }
    if (which == last && difference(camera_, before) < k_same) break;
    before = camera_;
    fit_together(which, round == 0);
    for (std::size_t i = 0; i < views_.size(); ++i) fit_again(i, std::ranges::count(which, i) > 0);
    last = std::move(which);
  }
  std::vector<PoseResult> results;
  for (MovingView& view : views_) {
    PoseResult& result = results.emplace_back(std::move(view.result()));
    result.start = view.start;
    result.history = std::move(view.history);
    result.iterations = static_cast<unsigned>(result.history.size());
    result.seconds = view.seconds;
  }
  return results;
}

std::vector<std::size_t> MovingFit::explained() const {
  std::vector<std::size_t> which;
  for (std::size_t i = 0; i < views_.size(); ++i)
    if (views_[i].fitted.result.explained) which.push_back(i);
  return which;
}

bool MovingFit::report(std::size_t view, PoseIteration step) {
  std::vector<PoseIteration>& history = views_[view].history;
  step.body = view;
  step.iteration = static_cast<unsigned>(history.size());
  history.push_back(step);
  goes_on_ = goes_on_ && (!callback_ || callback_(step));
  return goes_on_;
}

/// In the camera that was found last.
void MovingFit::fit_alone(std::size_t view, const std::vector<Pose>& initial, Foreknowledge known) {
  MovingView& own = views_[view];
  PoseProblem problem = own.problem;
  problem.scene.camera = calibrated(problem.scene.camera, camera_.focal_scale, camera_.radial);
  problem.options.solve_focal = problem.options.solve_distortion = false;
  if (known == Foreknowledge::pose) {  // which coarser images may lead away from
    auto& method = std::get<LeastSquares>(problem.options.method);
    method.rotations = 0;
    method.coarsest = static_cast<unsigned>(std::min(problem.scene.width, problem.scene.height));
  }
  const auto start = Clock::now();
  own.fitted = fit_pose(device_, {&problem, 1}, initial, known,
                        [&](const PoseIteration& step) { return report(view, step); });
  own.seconds += seconds_since(start);
  const auto see = [&](PoseHypothesis& h) { h.focal_scale = camera_.focal_scale, h.radial = camera_.radial; };
  see(own.result());
  std::ranges::for_each(own.result().equals, see);
}

/// In a camera that has changed: from the poses that were found along with it and before, or else from the start too.
void MovingFit::fit_again(std::size_t view, bool is_near) {
  MovingView& own = views_[view];
  const PoseResult last = own.result();
  std::vector<Pose> initial{last.pose};
  for (const PoseHypothesis& h : last.equals) initial.push_back(h.pose);
  if (!is_near) {
    initial.insert(initial.begin(), own.start);
    fit_alone(view, initial, known_);
    own.result().covariance.clear();
    return;
  }
  fit_alone(view, initial, Foreknowledge::pose);
  own.result().covariance = last.covariance;
}

/// From the coarsest level where the camera may be far off; it may lead poses astray that are nearly right.
void MovingFit::fit_together(const std::vector<std::size_t>& which, bool begins_coarse) {
  std::vector<JointView> views;
  for (const std::size_t i : which) views.emplace_back(views_[i], camera_);
  JointSystem system(views);
  const LeastSquares& method = views.front().view.method();
  const std::vector<LevelShape> shapes = level_shapes(views.front().pivot.scene(), method);
  for (std::size_t i = begins_coarse ? 0 : shapes.size() - 2; i < shapes.size(); ++i) {
    for (JointView& view : views) view.make_level(device_, shapes[i], i + 1 == shapes.size());
    const auto go_on = [&] {
      const JointView& first = views.front();
      const Hypothesis& h = first.hypothesis;
      return report(which.front(),
                    {0, 0, system.loss() / static_cast<double>(views.size()), first.level->smoothing(),
                     first.level->width(), first.level->height(), static_cast<unsigned>(views.size()),
                     first.pivot.to_origin(h.pose), h.focal_scale, h.radial});
    };
    if (!system.refine(k_patience * method.iterations, go_on)) break;
  }
  const std::vector<std::vector<double>> covariances = system.covariances();
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Hypothesis& h = views[i].hypothesis;
    PoseResult& result = views[i].view.result();
    result.covariance = covariances[i];
    views[i].pivot.to_origin(h.pose, result.covariance);
    result.pose = views[i].pivot.to_origin(h.pose);
    camera_ = {h.focal_scale, h.radial};
  }
}

}  // namespace

std::vector<PoseResult> solve_moving(const Device& device, const Scene& scene,
                                     std::span<const PoseView> views, const PoseOptions& options,
                                     PoseStart start, const PoseSolver::Callback& callback) {
  require_views(views, options);
  if (start == PoseStart::unknown)
    require(std::get<LeastSquares>(options.method).rotations > 0, "rotations (pose search)", 0, "at least 1");
  return MovingFit(device, scene, views, options, start, callback).run();
}

}  // namespace dpr
