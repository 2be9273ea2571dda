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

// How many hypotheses are turned at the coarsest level and at each one after it; the last number holds for all further.
constexpr std::array<std::size_t, 4> k_beam{96, 24, 12, 8};
// Hypotheses that move the object's rim by less than this against each other are one.
constexpr double k_same_pixels = 0.5;
// Losses that differ by no more than this part tell no pose from another: what the pixels' grid makes of one pose or
// its symmetric twin.
constexpr double k_equal_losses = 0.1;

// Losses beyond this multiple of the best one are given up before the next level.
constexpr double k_hopeless = 3;

bool by_loss(const Candidate& a, const Candidate& b) { return a.equations.loss < b.equations.loss; }

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
        initial_(initial.begin(), initial.end()),
        space_(scene, initial.front(), options.solve_translation, options.solve_focal) {}

  PoseResult run(bool anywhere);

 private:
  void start(PoseLevel& level);
  /// Refines all candidates at a level and keeps the best distinct ones. False if the callback stopped it.
  bool work(PoseLevel& level, std::size_t keep);
  void keep_distinct(const PoseLevel& level, std::size_t count);
  void finish(PoseLevel& level, bool anywhere);
  void choose_equals(bool anywhere);
  std::vector<double> covariance(const PoseLevel& level, const NormalEquations& equations) const;
  double reference_loss(PoseLevel& level, bool anywhere) const;
  bool report(const PoseLevel& level);

  const Device& device_;
  const Scene& scene_;
  const Image& target_;
  const PoseOptions& options_;
  const LeastSquares& method_;
  const PoseSolver::Callback& callback_;
  std::vector<Pose> initial_;
  PoseSpace space_;
  std::vector<Candidate> candidates_;
  PoseResult result_;
};

/// Short sides of the levels, the finest last.
std::vector<int> level_sizes(const Scene& scene, unsigned coarsest) {
  const int full = std::min(scene.width, scene.height);
  std::vector<int> sizes{full};
  while (sizes.front() / 2 >= static_cast<int>(std::min(coarsest, 1U << 30))) {
    sizes.insert(sizes.begin(), (sizes.front() + 1) / 2);
  }
  return sizes;
}

PoseResult Fit::run(bool anywhere) {
  const std::vector<int> sizes = level_sizes(scene_, method_.coarsest);
  bool goes_on = true;
  for (std::size_t i = 0; i < sizes.size() && goes_on; ++i) {
    PoseLevel level(device_, scene_, target_, method_, space_, sizes[i], method_.blur);
    if (i == 0) start(level);
    goes_on = work(level, k_beam[std::min(i + 1, k_beam.size() - 1)]);
  }
  PoseLevel finest(device_, scene_, target_, method_, space_, sizes.back(), method_.blur_end);
  if (goes_on) work(finest, k_beam.back()); 
  finish(finest, anywhere);
  return result_;
}

/// The initial poses, and the best of the grid.
void Fit::start(PoseLevel& level) {
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
  candidates_.resize(std::min(candidates_.size(), k_beam.front()));
  for (const Pose& pose : initial_) candidates_.push_back({{pose}});
}

bool Fit::work(PoseLevel& level, std::size_t keep) {
  const bool goes_on =
      refine(level, space_, candidates_, method_.iterations, [&] { return report(level); });
  std::ranges::stable_sort(candidates_, by_loss);
  keep_distinct(level, keep);
  return goes_on;
}

void Fit::keep_distinct(const PoseLevel& level, std::size_t count) {
  std::vector<Candidate> kept;
  for (const Candidate& candidate : candidates_) {
    const bool is_known = std::ranges::any_of(kept, [&](const Candidate& other) {
      return space_.distance(candidate.hypothesis, other.hypothesis) < k_same_pixels * level.pixel_ndc();
    });
    if (!is_known && kept.size() < count) kept.push_back(candidate);
  }
  candidates_ = std::move(kept);
  const double hopeless = k_hopeless * candidates_.front().equations.loss;
  std::erase_if(candidates_, [&](const Candidate& c) { return c.equations.loss > hopeless; });
}

bool Fit::report(const PoseLevel& level) {
  const Candidate& best = *std::ranges::min_element(candidates_, by_loss);
  const Smoothing& smoothing = level.smoothing();
  result_.history.push_back({static_cast<unsigned>(result_.history.size()), 0, best.equations.loss, smoothing.sigma,
                             smoothing.gamma, smoothing.samples, level.width(), level.height(),
                             static_cast<unsigned>(candidates_.size()), best.hypothesis.pose});
  return !callback_ || callback_(result_.history.back());
}

void Fit::finish(PoseLevel& level, bool anywhere) {
  choose_equals(anywhere);
  static_cast<PoseHypothesis&>(result_) = result_.equals.front();
  result_.covariance = covariance(level, candidates_.front().equations);
  result_.explained = result_.loss <= static_cast<double>(options_.explained) * reference_loss(level, anywhere);
}

/// The poses that explain the target as well as the best, the one to return first.
void Fit::choose_equals(bool anywhere) {
  const double enough = candidates_.front().equations.loss * (1 + k_equal_losses);
  std::erase_if(candidates_, [&](const Candidate& c) { return c.equations.loss > enough; });
  if (!anywhere) {
    const Hypothesis first{initial_.front()};
    std::ranges::stable_sort(candidates_, {}, [&](const Candidate& c) { return space_.distance(c.hypothesis, first); });
  }
  for (const auto& [hypothesis, equations] : candidates_) {
    result_.equals.push_back({hypothesis.pose, hypothesis.focal_scale, equations.loss});
  }
}

/// The residual's variance times the inverse Hessian of half the sum of squares.
std::vector<double> Fit::covariance(const PoseLevel& level, const NormalEquations& equations) const {
  constexpr double k_channels = 3;
  const double degrees_of_freedom = k_channels * level.weight() - static_cast<double>(space_.size());
  std::vector<double> inverse = inverse_hessian(equations, space_.size());
  if (degrees_of_freedom <= 0) return {};
  for (double& c : inverse) c *= equations.loss / degrees_of_freedom;
  return space_.to_world(inverse);
}

/// What a pose leaves that explains nothing: the initial one, or the middle one of the grid's.
double Fit::reference_loss(PoseLevel& level, bool anywhere) const {
  constexpr std::size_t k_enough = 31;  // for a median at the finest level, where renders are dear
  std::vector<Hypothesis> poses;
  if (anywhere) {
    for (const glm::dmat3& rotation : rotation_grid(k_enough)) poses.push_back({{rotation, initial_.front().translation}});
  } else {
    poses.push_back({initial_.front()});
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
  require(options.blur > 0 && std::isfinite(options.blur), "blur (pose)", options.blur, "a finite number above 0");
  require(options.robust >= 0 && std::isfinite(options.robust), "robust (pose)", options.robust,
          "a finite number, at least 0");
  const Image& mask = options.mask;
  if (mask.pixels.empty()) return;
  if (mask.width != scene.width || mask.height != scene.height) {
    throw InvalidArgument("size of the mask (pose)", std::to_string(mask.width) + "x" + std::to_string(mask.height),
                          std::to_string(scene.width) + "x" + std::to_string(scene.height) + ", the scene's");
  }
  double sum = 0;
  for (const glm::vec4& pixel : mask.pixels) {
    require(pixel.x >= 0 && pixel.x <= 1, "pixel of the mask (pose)", pixel.x, "a number in [0, 1]");
    sum += static_cast<double>(pixel.x);
  }
  require(sum > 0, "sum of the mask (pose)", sum, "a pixel above 0");
}

PoseResult fit_pose(const Device& device, const Scene& scene, const Image& target, const PoseOptions& options,
                    std::span<const Pose> initial, bool anywhere, const PoseSolver::Callback& callback) {
  return Fit(device, scene, target, options, initial, callback).run(anywhere);
}

}  // namespace dpr
