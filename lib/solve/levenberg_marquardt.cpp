// Damped Gauss-Newton steps in a batch.
#include "solve/levenberg_marquardt.hpp"

#include <algorithm>
#include <cmath>

namespace dpr {
namespace {

constexpr double k_still_deviations =
    0.3;  // steps shorter than this part of the pose's uncertainty change nothing
// Parts of the loss: what a step gains where no more is to be had, and what one loses that goes too far about the least.
constexpr double k_little_gain = 1e-4, k_little_loss = 1e-2;
// Steps like its last by which a candidate may reach the best one.
constexpr double k_steps_to_best = 20;

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

/// True if the gradient exceeds what the pixels give by chance: the score test g^T S^-1 g, where S is the
/// scatter of the pixels' gradients. Clutter elsewhere in the image plays no part.
bool is_significant(const NormalEquations& equations, std::size_t parameters) {
  auto factor = equations.scatter;
  if (!factorize(factor, parameters)) return true;
  PoseSpace::Step x = equations.gradient;
  substitute(factor, parameters, x);
  double squared = 0;
  for (std::size_t i = 0; i < parameters; ++i) squared += equations.gradient[i] * x[i];
  return squared > k_still_deviations * k_still_deviations;
}

/// The step to try next, no longer than a linear model reaches; none if the candidate stands still.
bool next_step(Candidate& candidate, const PoseSpace& space, double still_ndc, PoseSpace::Step& step) {
  const NormalEquations& equations = candidate.equations;
  while (candidate.damping < k_most_damping &&
         !damped_step(equations, space.size(), candidate.damping, step)) {
    candidate.damping *= k_damping_rise;
  }
  const double length = space.length(step);
  candidate.is_still =
      candidate.damping >= k_most_damping || length < still_ndc || !is_significant(equations, space.size());
  if (length > k_longest_step_ndc) {
    for (double& s : step) s *= k_longest_step_ndc / length;
  }
  return !candidate.is_still;
}

/// Takes the step, or else a shorter one next.
void judge(Candidate& candidate, const Hypothesis& hypothesis, const NormalEquations& equations) {
  if (equations.loss < candidate.equations.loss) {
    candidate.hypothesis = hypothesis;
    candidate.equations = equations;
    candidate.damping = std::max(candidate.damping * k_damping_fall, k_least_damping);
  } else {
    candidate.damping *= k_damping_rise;
  }
}

/// True if a candidate would not reach the `least` loss of all at the pace of a step that took `fall` off its own.
bool is_behind(const Candidate& candidate, double fall, double least) {
  return fall > 0 && candidate.equations.loss - k_steps_to_best * fall > least;
}

/// True if little is to be gained after a step that took `fall` off the loss.
bool is_settled(const Candidate& candidate, double fall) {
  return std::abs(fall) < (fall > 0 ? k_little_gain : k_little_loss) * candidate.equations.loss;
}

/// Linearizes the candidates that came from another level.
void linearize(PoseLevel& level, std::vector<Candidate>& candidates) {
  std::vector<Candidate*> fresh;
  std::vector<Hypothesis> hypotheses;
  for (Candidate& candidate : candidates) {
    if (candidate.damping > 0) continue;
    fresh.push_back(&candidate);
    hypotheses.push_back(candidate.hypothesis);
  }
  const std::vector<NormalEquations> equations = level.linearize(hypotheses);
  for (std::size_t i = 0; i < fresh.size(); ++i) {
    fresh[i]->equations = equations[i];
    fresh[i]->damping = k_first_damping;
  }
}

/// Takes the steps that lower the loss, and finds nothing else of them.
void judge_alone(PoseLevel& level, const std::vector<Candidate*>& moving,
                 const std::vector<Hypothesis>& hypotheses) {
  const std::vector<double> losses = level.losses(hypotheses);
  for (std::size_t i = 0; i < moving.size(); ++i) {
    if (losses[i] < moving[i]->equations.loss) {
      moving[i]->hypothesis = hypotheses[i];
      moving[i]->equations = {.loss = losses[i]};
    }
    moving[i]->restart();
  }
}

double least_loss(const std::vector<Candidate>& candidates) {
  const auto loss = [](const Candidate& candidate) { return candidate.equations.loss; };
  return std::ranges::min(candidates, {}, loss).equations.loss;
}

/// True if the best candidate still descends, after half of the turns steeply. `losses` are those of all iterations so far.
bool still_falls(const std::vector<double>& losses, unsigned most) {
  constexpr std::size_t k_last = 3;
  const double least_fall = losses.size() > most / 2 ? 0.1 : 0.03;  // over the last iterations
  return losses.size() > k_last && losses.back() < (1 - least_fall) * losses[losses.size() - 1 - k_last];
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
  // Of observations the best pose is not the only one that counts. A robust loss is mostly what it has given up on: its
  // parts say little.
  const bool counts_best = !level.has_observations(), is_squared = counts_best && level.color_scale() == 0;
  linearize(level, candidates);
  std::vector<double> losses;
  for (unsigned iteration = 0; iteration < turns.most; ++iteration) {
    losses.push_back(least_loss(candidates));
    const bool is_enough = iteration >= turns.enough;
    if (is_enough && !turns.longer_pixels && !still_falls(losses, turns.most)) break;
    const double still_pixels = is_enough ? turns.longer_pixels.value_or(k_still_pixels) : k_still_pixels;
    if (!report()) return false;
    std::vector<Candidate*> moving;
    std::vector<Hypothesis> hypotheses;
    for (Candidate& candidate : candidates) {
      PoseSpace::Step step{};
      if (candidate.is_still || !next_step(candidate, space, still_pixels * level.pixel_ndc(), step))
        continue;
      moving.push_back(&candidate);
      hypotheses.push_back(space.moved(candidate.hypothesis, step));
    }
    if (moving.empty()) break;
    if (turns.is_end && iteration + 1 == turns.most) {
      judge_alone(level, moving, hypotheses);
      break;
    }
    const std::vector<NormalEquations> equations = level.linearize(hypotheses);
    for (std::size_t i = 0; i < moving.size(); ++i) {
      const double fall = moving[i]->equations.loss - equations[i].loss;
      judge(*moving[i], hypotheses[i], equations[i]);
      moving[i]->is_still = (counts_best && is_behind(*moving[i], fall, losses.back())) ||
                            (is_squared && is_settled(*moving[i], fall));
    }
  }
  return true;
}

}  // namespace dpr
