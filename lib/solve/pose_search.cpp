// Hypotheses from a grid of rotations, halved from level to level.
#include "solve/pose_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <string>

#include "solve/levenberg_marquardt.hpp"
#include "solve/require.hpp"
#include "solve/rotation_grid.hpp"

namespace dpr {
namespace {

// How many hypotheses are turned at the coarsest level and at each one after it; the last number holds for
// all further. A robust loss says little of a pose until details show: more must stay.
using Beam = std::array<std::size_t, 4>;
constexpr Beam k_beam{96, 24, 12, 8}, k_robust_beam{192, 96, 32, 8};
// Hypotheses that move the object's rim by less than this against each other are one.
constexpr double k_same_pixels = 0.5;
// Losses that differ by no more than this part of what a wrong pose leaves tell no pose from another: the
// pixels' grid makes that much of one pose or its symmetric twin.
constexpr double k_equal_losses = 1e-3;

// Hypotheses are given up before the next level where their loss is beyond this multiple of the best one and,
// besides, this part of what a wrong pose leaves: the best may fit its pixels by luck.
constexpr double k_hopeless_ratio = 3, k_hopeless_part = 0.02;

bool by_loss(const Candidate& a, const Candidate& b) { return a.equations.loss < b.equations.loss; }

struct LevelShape {
  int short_side;
  float blur;
};

/// The resolution doubles; the last level is the finest once more, with the final blur.
std::vector<LevelShape> level_shapes(const Scene& scene, const LeastSquares& options) {
  const int full = std::min(scene.width, scene.height);
  std::vector<LevelShape> shapes{{full, options.blur}};
  while (static_cast<unsigned>(shapes.front().short_side / 2) >= options.coarsest) {
    shapes.insert(shapes.begin(), {(shapes.front().short_side + 1) / 2, options.blur});
  }
  shapes.push_back({full, options.blur_end});
  return shapes;
}

/// One fit at work: the candidates on their way through the levels.
class Fit {
 public:
  Fit(const Device& device, const Scene& scene, const Image& target, const PoseOptions& options,
      std::span<const Pose> initial, const PoseSolver::Callback& callback)
      : device_(device),
        scene_(scene),
        target_(target),
        options_(options),
        method_(std::get<LeastSquares>(options.method)),
        callback_(callback),
        beam_(method_.robust ? k_robust_beam : k_beam),
        initial_(initial.begin(), initial.end()),
        space_(scene, initial.front(), options.solve_translation, options.solve_focal) {}

  PoseResult run(bool anywhere);

 private:
  void start(PoseLevel& level);
  bool descend(const std::vector<LevelShape>& shapes, const std::vector<Candidate>& found);
  PoseLevel make_level(const LevelShape& shape, PoseLight light) const;
  bool is_unexplained(std::size_t level) const;
  bool light_differs(PoseLevel& level, const LevelShape& shape) const;
  void make_robust(PoseLevel& level, std::span<const Hypothesis> hypotheses);
  std::vector<Hypothesis> hypotheses() const;
  std::vector<Hypothesis> grid(std::size_t rotations) const;
  /// Refines all candidates at a level and keeps the best distinct ones.
  void work(PoseLevel& level, std::size_t keep);
  void keep_distinct(const PoseLevel& level, std::size_t count);
  void finish(PoseLevel& level, bool anywhere);
  void choose_equals(bool anywhere);
  double wrong_loss(PoseLevel& level) const;
  bool report(const PoseLevel& level);

  const Device& device_;
  const Scene& scene_;
  const Image& target_;
  const PoseOptions& options_;
  const LeastSquares& method_;
  const PoseSolver::Callback& callback_;
  const Beam& beam_;
  std::vector<Pose> initial_;
  PoseSpace space_;
  PoseLight light_ = PoseLight::fixed;  // tried at present
  bool goes_on_ = true;
  std::vector<Candidate> candidates_;
  double wrong_ = 0;  // loss of a pose that explains nothing, at the coarsest or the finest level
  PoseResult result_;
};

PoseResult Fit::run(bool anywhere) {
  result_.start = initial_.front();
  const std::vector<LevelShape> shapes = level_shapes(scene_, method_);
  if (!descend(shapes, {}) && method_.light != PoseLight::fixed && goes_on_) {
    const std::vector<Candidate> found = std::move(candidates_);
    light_ = method_.light;
    descend(shapes, found);
  }
  PoseLevel level = make_level(shapes.back(), light_);
  make_robust(level, hypotheses());
  work(level, beam_.back());
  finish(level, anywhere);
  return result_;
}

/// Through all levels but the last, where `found` come in again. Returns false if another light should be
/// tried.
bool Fit::descend(const std::vector<LevelShape>& shapes, const std::vector<Candidate>& found) {
  candidates_.clear();
  for (std::size_t i = 0; i + 1 < shapes.size() && (goes_on_ || i == 0); ++i) {
    const bool is_finest = i + 2 == shapes.size();
    // Of a light's direction the coarsest images say so little that it would explain any pose.
    const bool is_known = light_ == PoseLight::fixed || i > 0 || is_finest;
    PoseLevel level = make_level(shapes[i], is_known ? light_ : PoseLight::gain);
    if (i == 0) start(level);
    if (is_finest) candidates_.insert(candidates_.end(), found.begin(), found.end());
    if (i > 0) make_robust(level, hypotheses());
    work(level, beam_[std::min(i + 1, beam_.size() - 1)]);
    if (light_ != PoseLight::fixed) continue;
    if (is_finest ? light_differs(level, shapes[i]) : is_unexplained(i)) return false;
  }
  return true;
}

PoseLevel Fit::make_level(const LevelShape& shape, PoseLight light) const {
  return PoseLevel(device_, scene_, target_, method_, space_, shape.short_side, shape.blur, light);
}

/// Whether a further look for the pose in the scene's own light is in vain. A robust loss can't tell.
bool Fit::is_unexplained(std::size_t level) const {
  constexpr double k_unexplained = 0.2;  // of what a wrong pose leaves
  return level > 0 && !method_.robust && candidates_.front().equations.loss > k_unexplained * wrong_;
}

/// Whether most of the object looks so much better in a light of its own that it's not the scene's.
bool Fit::light_differs(PoseLevel& level, const LevelShape& shape) const {
  constexpr float k_better = 0.7F;
  if (method_.light == PoseLight::fixed) return false;
  PoseLevel lit = make_level(shape, method_.light);
  level.estimate_scale(hypotheses());
  lit.estimate_scale(hypotheses());
  return lit.scale() < k_better * level.scale();
}

void Fit::make_robust(PoseLevel& level, std::span<const Hypothesis> hypotheses) {
  if (!method_.robust) return;
  if (method_.robust_scale > 0) {
    level.set_scale(method_.robust_scale);
  } else {
    // Tighter, the loss would see nothing but what hypotheses on their way hit by chance.
    constexpr float k_least_scale = 0.1F;
    level.estimate_scale(hypotheses);
    if (level.scale() > 0) level.set_scale(std::max(level.scale(), k_least_scale));
  }
}

std::vector<Hypothesis> Fit::hypotheses() const {
  std::vector<Hypothesis> result;
  for (const Candidate& candidate : candidates_) result.push_back(candidate.hypothesis);
  return result;
}

/// At the initial translation.
std::vector<Hypothesis> Fit::grid(std::size_t rotations) const {
  std::vector<Hypothesis> result;
  for (const glm::dmat3& rotation : rotation_grid(rotations)) {
    result.push_back({{rotation, initial_.front().translation}});
  }
  return result;
}

/// The initial poses, and the best of the grid.
void Fit::start(PoseLevel& level) {
  constexpr std::size_t k_enough = 144;  // to know the scale
  std::vector<Hypothesis> some = grid(std::min<std::size_t>(method_.rotations, k_enough));
  for (const Pose& pose : initial_) some.push_back({pose});
  make_robust(level, some);
  wrong_ = wrong_loss(level);
  const std::vector<Hypothesis> grid = this->grid(method_.rotations);
  const std::vector<double> losses = level.losses(grid);
  for (std::size_t i = 0; i < grid.size(); ++i) {
    candidates_.push_back({grid[i]});
    candidates_.back().equations.loss = losses[i];
  }
  std::ranges::stable_sort(candidates_, by_loss);
  candidates_.resize(std::min(candidates_.size(), beam_.front()));
  for (const Pose& pose : initial_) candidates_.push_back({{pose}});
  candidates_[candidates_.size() - initial_.size()].is_initial = true;
}

void Fit::work(PoseLevel& level, std::size_t keep) {
  const unsigned iterations = goes_on_ ? method_.iterations : 0;  // stopped: only judged at this level
  goes_on_ = refine(level, space_, candidates_, iterations, [&] { return report(level); }) && goes_on_;
  std::ranges::stable_sort(candidates_, by_loss);
  keep_distinct(level, keep);
}

void Fit::keep_distinct(const PoseLevel& level, std::size_t count) {
  std::vector<Candidate> kept;
  for (const Candidate& candidate : candidates_) {
    const auto same = std::ranges::find_if(kept, [&](const Candidate& other) {
      return space_.distance(candidate.hypothesis, other.hypothesis) < k_same_pixels * level.pixel_ndc();
    });
    if (same != kept.end()) {
      same->is_initial = same->is_initial || candidate.is_initial;
    } else if (kept.size() < count || candidate.is_initial) {  // which may be the nearest of many equals
      kept.push_back(candidate);
    }
  }
  candidates_ = std::move(kept);
  const double hopeless = k_hopeless_ratio * candidates_.front().equations.loss + k_hopeless_part * wrong_;
  std::erase_if(candidates_, [&](const Candidate& c) { return c.equations.loss > hopeless; });
}

bool Fit::report(const PoseLevel& level) {
  const Candidate& best = *std::ranges::min_element(candidates_, by_loss);
  result_.history.push_back({static_cast<unsigned>(result_.history.size()), 0, best.equations.loss,
                             level.smoothing(), level.width(), level.height(),
                             static_cast<unsigned>(candidates_.size()), best.hypothesis.pose,
                             best.hypothesis.focal_scale});
  return !callback_ || callback_(result_.history.back());
}

void Fit::finish(PoseLevel& level, bool anywhere) {
  wrong_ = wrong_loss(level);
  choose_equals(anywhere);
  static_cast<PoseHypothesis&>(result_) = result_.equals.front();
  result_.covariance = covariance(candidates_.front().equations, space_.size());
  if (!result_.covariance.empty()) result_.covariance = space_.to_world(result_.covariance);
  result_.explained = result_.loss <= static_cast<double>(options_.explained) * wrong_;
}

/// The poses that explain the target as well as the best, the one to return first.
void Fit::choose_equals(bool anywhere) {
  const double best = candidates_.front().equations.loss;
  const double enough = best + k_equal_losses * std::max(wrong_ - best, 0.0);
  std::erase_if(candidates_, [&](const Candidate& c) { return c.equations.loss > enough; });
  if (!anywhere) {
    const Hypothesis first{initial_.front()};
    std::ranges::stable_sort(candidates_, {},
                             [&](const Candidate& c) { return space_.distance(c.hypothesis, first); });
  }
  for (const Candidate& c : candidates_) {
    result_.equals.push_back({c.hypothesis.pose, c.hypothesis.focal_scale, c.equations.loss});
  }
}

/// What a pose leaves that explains nothing: the median over rotations.
double Fit::wrong_loss(PoseLevel& level) const {
  constexpr std::size_t k_enough = 15;  // the finest level's renders are dear
  std::vector<double> losses = level.losses(grid(k_enough));
  std::ranges::nth_element(losses, losses.begin() + std::ssize(losses) / 2);
  return losses[losses.size() / 2];
}

}  // namespace

void validate(const LeastSquares& options, const Scene& scene) {
  constexpr unsigned k_most_rotations = 1U << 24;
  require(options.rotations <= k_most_rotations, "rotations (pose)", options.rotations, "at most 2^24");
  require(options.coarsest > 0, "coarsest (pose)", options.coarsest, "at least 1");
  require(options.iterations > 0, "iterations (pose)", options.iterations, "at least 1");
  require(options.blur > 0 && std::isfinite(options.blur), "blur (pose)", options.blur,
          "a finite number above 0");
  require(options.blur_end > 0 && std::isfinite(options.blur_end), "blur_end (pose)", options.blur_end,
          "a finite number above 0");
  require(options.robust_scale >= 0 && std::isfinite(options.robust_scale), "robust_scale (pose)",
          options.robust_scale, "a finite number, at least 0");
  const Image& mask = options.mask;
  if (mask.pixels.empty()) return;
  if (mask.width != scene.width || mask.height != scene.height) {
    throw InvalidArgument("size of the mask (pose)", checks::size(mask.width, mask.height),
                          checks::size(scene.width, scene.height) + ", the scene's");
  }
  double sum = 0;
  for (const glm::vec4& pixel : mask.pixels) {
    require(pixel.x >= 0 && pixel.x <= 1, "pixel of the mask (pose)", pixel.x, "a number in [0, 1]");
    sum += static_cast<double>(pixel.x);
  }
  require(sum > 0, "sum of the mask (pose)", sum, "a pixel above 0");
}

unsigned most_iterations(const LeastSquares& options, const Scene& scene) {
  const auto levels = static_cast<unsigned>(level_shapes(scene, options).size());
  const unsigned again = options.light == PoseLight::fixed ? 0 : levels - 1;  // in another light
  return k_patience * options.iterations * (levels + again);
}

PoseResult fit_pose(const Device& device, const Scene& scene, const Image& target, const PoseOptions& options,
                    std::span<const Pose> initial, bool anywhere, const PoseSolver::Callback& callback) {
  return Fit(device, scene, target, options, initial, callback).run(anywhere);
}

}  // namespace dpr
