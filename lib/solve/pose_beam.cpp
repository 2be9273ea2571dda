// Beams of hypotheses.
#include "solve/pose_beam.hpp"

#include <algorithm>
#include <cmath>

#include "solve/median.hpp"
#include "solve/rotation_grid.hpp"

namespace dpr {
namespace {

// A robust loss says little of a pose until details show: more must stay.
constexpr Beam k_beam{96, 24, 12, 8}, k_robust_beam{192, 96, 32, 8};
// Hypotheses that move the object's rim by less than this against each other are one.
constexpr double k_same_pixels = 0.5;

}  // namespace

const Beam& beam_of(const LeastSquares& method) { return method.robust ? k_robust_beam : k_beam; }

std::size_t most_at(const Beam& beam, std::size_t level) { return beam[std::min(level, beam.size() - 1)]; }

double explained_part(float explained, bool is_robust) {
  return static_cast<double>(is_robust ? std::sqrt(explained) : explained);
}

std::vector<Hypothesis> hypotheses_at(const glm::dvec3& translation, std::size_t rotations) {
  std::vector<Hypothesis> result;
  for (const glm::dmat3& rotation : rotation_grid(rotations)) result.push_back({{rotation, translation}});
  return result;
}

double wrong_loss(PoseLevel& level, std::span<const Hypothesis> hypotheses) {
  return median(level.losses(hypotheses));
}

std::vector<Candidate> least_losses(PoseLevel& level, std::span<const Hypothesis> hypotheses,
                                    std::size_t count) {
  const std::vector<double> losses = level.losses(hypotheses);
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < hypotheses.size(); ++i) {
    candidates.push_back({hypotheses[i]});
    candidates.back().equations.loss = losses[i];
  }
  std::ranges::stable_sort(candidates, by_loss);
  candidates.resize(std::min(candidates.size(), count));
  return candidates;
}

bool refine_distinct(PoseLevel& level, const PoseSpace& space, std::vector<Candidate>& candidates,
                     const BeamWork& work, const std::function<bool()>& report) {
  constexpr unsigned k_few = 4;  // within which many come to the same pose, or to none
  const auto keep_distinct = [&](std::size_t count) {
    candidates = distinct(std::move(candidates), space, k_same_pixels * level.pixel_ndc(), count);
    drop_hopeless(candidates, 0, k_hope, work.wrong_loss);
  };
  const unsigned enough = work.iterations, few = std::min(k_few, enough);
  for (Candidate& candidate : candidates) candidate.restart();
  bool goes_on = refine(level, space, candidates, {few, few}, report);
  keep_distinct(std::min(candidates.size(), work.promising));
  if (goes_on && enough > few)
    goes_on = refine(level, space, candidates, {enough - few, k_patience * enough - few}, report);
  keep_distinct(work.keep);
  return goes_on;
}

void drop_hopeless_at(PoseLevel& level, std::vector<Candidate>& candidates, std::size_t first,
                      const Hope& hope, double wrong_loss) {
  const std::vector<double> losses = level.losses(hypotheses_of(candidates));
  for (std::size_t i = 0; i < losses.size(); ++i) candidates[i].equations.loss = losses[i];
  drop_hopeless(candidates, first, hope, wrong_loss);
}

void add_half_turns(std::vector<Candidate>& candidates, std::span<const glm::dmat3> half_turns,
                    std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    for (const glm::dmat3& turn : half_turns) {
      Candidate turned = candidates[i];
      turned.hypothesis.pose.rotation *= turn;
      turned.is_initial = false;
      candidates.push_back(turned);
    }
  }
}

namespace {

constexpr std::size_t k_most_equals =
    64;  // a solid's own turns are at most 60, those of a round body without number

/// Poses to which the motions between the first of `equals` and the others lead from `candidates`, but for those nearer
/// than `apart` to one of `known`, which they join.
std::vector<Candidate> moved_alike(std::span<const Candidate> equals, std::span<const Candidate> candidates,
                                   const PoseSpace& space, double apart, std::vector<Hypothesis>& known) {
  std::vector<Candidate> found;
  const Pose& first = equals.front().hypothesis.pose;
  const glm::dmat3 back = glm::transpose(first.rotation);
  for (const Candidate& candidate : candidates) {
    for (const Candidate& other : equals.subspan(1)) {
      Hypothesis moved = candidate.hypothesis;
      const glm::dmat3 turn = moved.pose.rotation * back;
      moved.pose.translation += turn * (other.hypothesis.pose.translation - first.translation);
      moved.pose.rotation = turn * other.hypothesis.pose.rotation;
      const auto is_near = [&](const Hypothesis& h) { return space.distance(h, moved) < apart; };
      if (known.size() >= k_most_equals || std::ranges::any_of(known, is_near)) continue;
      known.push_back(moved);
      found.push_back({moved});
    }
  }
  return found;
}

}  // namespace

void add_equals(PoseLevel& level, const PoseSpace& space, std::vector<Candidate>& equals,
                std::vector<Candidate> spare, const EqualsWork& work) {
  constexpr std::size_t k_most_spare = 16;  // which is enough to find a body's turns by
  constexpr double k_apart = 0.1;           // of the object's radius: closer ones are one
  const double apart = k_apart * space.radius_ndc();
  const auto add = [&](std::vector<Candidate> others) {
    for (Candidate& candidate : others) candidate.restart();
    if (others.empty()) return;
    refine(level, space, others, {work.iterations, work.iterations}, [] { return true; });
    for (const Candidate& c : others) {
      const auto is_near = [&](const Candidate& other) {
        return space.distance(c.hypothesis, other.hypothesis) < apart;
      };
      if (c.equations.loss <= work.most_loss && std::ranges::none_of(equals, is_near)) equals.push_back(c);
    }
  };
  add(distinct(std::move(spare), space, apart, k_most_spare));
  const std::vector<Candidate> first = equals;
  std::vector<Hypothesis> known = hypotheses_of(equals);
  for (std::size_t from = 0; from < equals.size();) {
    const std::vector<Candidate> last(equals.begin() + static_cast<std::ptrdiff_t>(from), equals.end());
    from = equals.size();
    add(moved_alike(first, last, space, apart, known));
  }
}

double enough_to_equal(double best, double wrong) {
  return best + k_equal_losses * std::max(wrong - best, 0.0);
}

void set_robust_scale(PoseLevel& level, const LeastSquares& method, std::span<const Hypothesis> hypotheses) {
  // Tighter, the loss would see nothing but what hypotheses on their way hit by chance. Wider, as the
  // residuals of wrong hypotheses have it, clutter would count.
  constexpr float k_least_robust_scale = 0.1F, k_most_robust_scale = 0.12F;
  // There is no clutter but what is in front.
  constexpr float k_unknown_background_scale = 0.2F;
  if (method.robust_scale > 0 || method.unknown_background) {
    level.set_color_scale(method.robust_scale > 0 ? method.robust_scale : k_unknown_background_scale);
    return;
  }
  level.estimate_scale(hypotheses);
  level.clamp_color_scales(k_least_robust_scale, k_most_robust_scale);
}

std::vector<double> pose_covariance(PoseLevel& level, const PoseSpace& space, const Hypothesis& hypothesis) {
  const std::vector<double> result = covariance(level.judge(hypothesis), space.size());
  return result.empty() ? result : space.to_world(result);
}

}  // namespace dpr
