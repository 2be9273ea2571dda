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
        beam_(method_.robust > 0 ? k_robust_beam : k_beam),
        initial_(initial.begin(), initial.end()),
        space_(scene, initial.front(), options.solve_translation, options.solve_focal) {}

  PoseResult run(bool anywhere);

 private:
  void start(PoseLevel& level);
  /// Refines all candidates at a level and keeps the best distinct ones. False if the callback stopped it.
  bool work(PoseLevel& level, std::size_t keep, bool goes_on);
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
  std::vector<Candidate> candidates_;
  double wrong_ = 0;  // loss of a pose that explains nothing, at the coarsest or the finest level
  PoseResult result_;
};

PoseResult Fit::run(bool anywhere) {
  result_.start = initial_.front();
  const std::vector<LevelShape> levels = level_shapes(scene_, method_);
  bool goes_on = true;
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const bool is_last = i + 1 == levels.size();
    if (!goes_on && !is_last) continue;
    PoseLevel level(device_, scene_, target_, method_, space_, levels[i].short_side, levels[i].blur);
    if (i == 0) start(level);
    goes_on = work(level, beam_[std::min(i + 1, beam_.size() - 1)], goes_on);
    if (is_last) finish(level, anywhere);
  }
  return result_;
}

/// The initial poses, and the best of the grid.
void Fit::start(PoseLevel& level) {
  wrong_ = wrong_loss(level);
  std::vector<Hypothesis> grid;
  for (const glm::dmat3& rotation : rotation_grid(method_.rotations)) {
    grid.push_back({{rotation, initial_.front().translation}});
  }
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

bool Fit::work(PoseLevel& level, std::size_t keep, bool goes_on) {
  const unsigned iterations = goes_on ? method_.iterations : 0;  // stopped: only judged at this level
  goes_on = refine(level, space_, candidates_, iterations, [&] { return report(level); }) && goes_on;
  std::ranges::stable_sort(candidates_, by_loss);
  keep_distinct(level, keep);
  return goes_on;
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
  std::vector<Hypothesis> poses;
  for (const glm::dmat3& rotation : rotation_grid(k_enough)) {
    poses.push_back({{rotation, initial_.front().translation}});
  }
  std::vector<double> losses = level.losses(poses);
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
  require(options.robust >= 0 && std::isfinite(options.robust), "robust (pose)", options.robust,
          "a finite number, at least 0");
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
  return k_patience * options.iterations * static_cast<unsigned>(level_shapes(scene, options).size());
}

PoseResult fit_pose(const Device& device, const Scene& scene, const Image& target, const PoseOptions& options,
                    std::span<const Pose> initial, bool anywhere, const PoseSolver::Callback& callback) {
  return Fit(device, scene, target, options, initial, callback).run(anywhere);
}

}  // namespace dpr
