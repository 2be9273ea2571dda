// Damped Gauss-Newton steps in a batch.
#include "solve/levenberg_marquardt.hpp"

#include <algorithm>
#include <cmath>

namespace dpr {
namespace {

// Marquardt's factor on the diagonal: where it begins, how it falls and rises, and where hope ends.
constexpr double k_first_damping = 1e-2;
constexpr double k_damping_fall = 0.2, k_damping_rise = 8;
constexpr double k_least_damping = 1e-7, k_most_damping = 10;

constexpr double k_longest_step_ndc = 0.25;  // a linear model of images reaches no further
constexpr double k_still_pixels = 1e-2;      // steps shorter than this change nothing that can be seen

/// The lower Cholesky factor of a symmetric matrix; false if it is not positive definite to rounding.
bool factorize(PoseSpace::Matrix& a, std::size_t n) {
  constexpr double k_rounding = 1e-12;
  for (std::size_t j = 0; j < n; ++j) {
    const double diagonal = a[j * n + j];
    for (std::size_t i = j; i < n; ++i) {
      for (std::size_t k = 0; k < j; ++k) a[i * n + j] -= a[i * n + k] * a[j * n + k];
      if (i == j) {
        if (!(a[j * n + j] > k_rounding * diagonal)) return false;
        a[j * n + j] = std::sqrt(a[j * n + j]);
      } else {
        a[i * n + j] /= a[j * n + j];
      }
    }
  }
  return true;
}

/// Solves L L^T x = b in place.
void substitute(const PoseSpace::Matrix& factor, std::size_t n, PoseSpace::Step& b) {
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < i; ++k) b[i] -= factor[i * n + k] * b[k];
    b[i] /= factor[i * n + i];
  }
  for (std::size_t i = n; i-- > 0;) {
    for (std::size_t k = i + 1; k < n; ++k) b[i] -= factor[k * n + i] * b[k];
    b[i] /= factor[i * n + i];
  }
}

/// A candidate, its damping, and the step it tries.
struct Trial {
  Candidate* candidate;
  double damping = k_first_damping;
  bool still = false;
};

/// The step to try next, no longer than a linear model reaches; none if the candidate stands still.
bool next_step(Trial& trial, const PoseSpace& space, double pixel_ndc, PoseSpace::Step& step) {
  while (trial.damping < k_most_damping &&
         !damped_step(trial.candidate->equations, space.size(), trial.damping, step)) {
    trial.damping *= k_damping_rise;
  }
  const double length = space.length(step);
  trial.still = trial.still || trial.damping >= k_most_damping || length < k_still_pixels * pixel_ndc;
  if (length > k_longest_step_ndc) {
    for (double& s : step) s *= k_longest_step_ndc / length;
  }
  return !trial.still;
}

void judge(Trial& trial, const Hypothesis& hypothesis, const NormalEquations& equations) {
  const double before = trial.candidate->equations.loss;
  if (equations.loss < before) {
    trial.candidate->hypothesis = hypothesis;
    trial.candidate->equations = equations;
    trial.damping = std::max(trial.damping * k_damping_fall, k_least_damping);
  } else {
    trial.damping *= k_damping_rise;
  }
}

double least_loss(const std::vector<Candidate>& candidates) {
  const auto loss = [](const Candidate& candidate) { return candidate.equations.loss; };
  return std::ranges::min(candidates, {}, loss).equations.loss;
}

/// Whether the best candidate is still on its way: losses of all iterations so far.
bool still_falls(const std::vector<double>& losses) {
  constexpr std::size_t k_last = 3;
  constexpr double k_least_fall = 0.03;  // over the last iterations
  return losses.size() > k_last && losses.back() < (1 - k_least_fall) * losses[losses.size() - 1 - k_last];
}

}  // namespace

bool damped_step(const NormalEquations& equations, std::size_t parameters, double damping,
                 PoseSpace::Step& step) {
  auto factor = equations.hessian;
  for (std::size_t i = 0; i < parameters; ++i) factor[i * parameters + i] *= 1 + damping;
  step = {};
  if (!factorize(factor, parameters)) return false;
  for (std::size_t i = 0; i < parameters; ++i) step[i] = -equations.gradient[i];
  substitute(factor, parameters, step);
  return true;
}

std::vector<double> covariance(const NormalEquations& equations, std::size_t parameters) {
  auto factor = equations.hessian;
  if (!factorize(factor, parameters)) return {};
  // H^-1 from both sides: on the columns of S, then on the columns of the transpose of what comes out.
  std::vector<double> result(
      equations.scatter.begin(),
      equations.scatter.begin() + static_cast<std::ptrdiff_t>(parameters * parameters));
  for (int side = 0; side < 2; ++side) {
    std::vector<double> solved(parameters * parameters);
    for (std::size_t column = 0; column < parameters; ++column) {
      PoseSpace::Step x{};
      for (std::size_t row = 0; row < parameters; ++row) x[row] = result[row * parameters + column];
      substitute(factor, parameters, x);
      for (std::size_t row = 0; row < parameters; ++row) solved[column * parameters + row] = x[row];
    }
    result = solved;
  }
  return result;
}

bool refine(PoseLevel& level, const PoseSpace& space, std::vector<Candidate>& candidates, const Turns& turns,
            const std::function<bool()>& report) {
  std::vector<Hypothesis> hypotheses;
  std::vector<Trial> trials;
  for (Candidate& candidate : candidates) {
    hypotheses.push_back(candidate.hypothesis);
    trials.push_back({&candidate});
  }
  std::vector<NormalEquations> equations = level.linearize(hypotheses);
  for (std::size_t i = 0; i < trials.size(); ++i) candidates[i].equations = equations[i];

  std::vector<double> losses;
  for (unsigned iteration = 0; iteration < turns.most; ++iteration) {
    losses.push_back(least_loss(candidates));
    if (iteration >= turns.enough && !still_falls(losses)) break;
    if (!report()) return false;
    std::vector<Trial*> moving;
    hypotheses.clear();
    for (Trial& trial : trials) {
      PoseSpace::Step step{};
      if (trial.still || !next_step(trial, space, level.pixel_ndc(), step)) continue;
      moving.push_back(&trial);
      hypotheses.push_back(space.moved(trial.candidate->hypothesis, step));
    }
    if (moving.empty()) break;
    equations = level.linearize(hypotheses);
    for (std::size_t i = 0; i < moving.size(); ++i) judge(*moving[i], hypotheses[i], equations[i]);
  }
  return true;
}

}  // namespace dpr
