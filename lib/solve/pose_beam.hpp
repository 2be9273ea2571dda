// What a search for a pose and the tracking of one share: hypotheses that are refined at a level, and how much a wrong
// one leaves.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "solve/pose_candidates.hpp"
#include "solve/pose_level.hpp"

namespace dpr {

/// Numbers of hypotheses that are turned at the coarsest level and at each one after it; the last holds for
/// all further.
using Beam = std::array<std::size_t, 4>;
const Beam& beam_of(const LeastSquares& method);
/// Of that level.
std::size_t most_at(const Beam& beam, std::size_t level);

/// Candidates whose losses differ by no more than this part of what a wrong pose leaves are equals: the pixels' grid
/// makes that much of one pose or its symmetric twin.
inline constexpr double k_equal_losses = 1e-3;
/// What a pose must cover of what is compared, before a background that is not known, to explain anything.
inline constexpr double k_least_covered = 1e-3;

/// The last level of a search changes less than those before it.
inline constexpr Hope k_hope{3, 0.02}, k_last_hope{1.5, 0.005};

/// Part of a loss below which a target counts as explained: a robust loss of what is wrong grows with its area alone,
/// no longer with its size.
double explained_part(float explained, bool is_robust);

/// Rotations spread over all, at one place.
std::vector<Hypothesis> hypotheses_at(const glm::dvec3& translation, std::size_t rotations);

/// Loss of a pose that explains nothing: the median over hypotheses spread over all rotations.
double wrong_loss(PoseLevel& level, std::span<const Hypothesis> hypotheses);

/// The hypotheses that leave least at a level, the best first; not linearized.
std::vector<Candidate> least_losses(PoseLevel& level, std::span<const Hypothesis> hypotheses,
                                    std::size_t count);

/// How candidates are refined at a level.
struct BeamWork {
  unsigned iterations = 0;  ///< 0: they are only judged at the level
  std::size_t keep = 1;
  double wrong_loss = 0;  ///< of a pose that explains nothing
  std::size_t promising =
      std::numeric_limits<std::size_t>::max();  ///< so many are refined beyond the first steps
};

/// Turns all candidates until they stand still, and keeps the best distinct ones, the best first. Returns false if
/// `report`, called after every iteration, stopped it.
bool refine_distinct(PoseLevel& level, const PoseSpace& space, std::vector<Candidate>& candidates,
                     const BeamWork& work, const std::function<bool()>& report);

/// Gives up those from the `first` on by what they leave at a level, as they are.
void drop_hopeless_at(PoseLevel& level, std::vector<Candidate>& candidates, std::size_t first,
                      const Hope& hope, double wrong_loss);

/// Adds the best `count` after half a turn about each of the object's axes.
void add_half_turns(std::vector<Candidate>& candidates, std::span<const glm::dmat3> half_turns,
                    std::size_t count);

struct EqualsWork {
  unsigned iterations;
  double most_loss;  ///< of an equal of the best
};

/// To poses that explain the target, the best first, adds those of `spare` that do, and what the motions between all of
/// them lead to: these may be the object's own. Up to 64.
void add_equals(PoseLevel& level, const PoseSpace& space, std::vector<Candidate>& equals,
                std::vector<Candidate> spare, const EqualsWork& work);

/// The largest loss that tells a pose from the best no more.
double enough_to_equal(double best, double wrong);

/// The scale of colours' robust loss that the options give, or else of what the hypotheses leave, within bounds. Squares
/// stay where no hypothesis shows the object.
void set_robust_scale(PoseLevel& level, const LeastSquares& method, std::span<const Hypothesis> hypotheses);

/// Covariance of the pose in world axes, as PoseResult has it; empty where the image leaves a parameter open.
std::vector<double> pose_covariance(PoseLevel& level, const PoseSpace& space, const Hypothesis& hypothesis);

}  // namespace dpr
