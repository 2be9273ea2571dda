// Levenberg-Marquardt steps of many hypotheses at once.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "solve/pose_level.hpp"

namespace dpr {

// Marquardt's factor on the diagonal: where it begins, how it falls and rises, and where hope ends.
inline constexpr double k_first_damping = 1e-2;
inline constexpr double k_damping_fall = 0.2, k_damping_rise = 8;
inline constexpr double k_least_damping = 1e-7, k_most_damping = 10;

inline constexpr double k_longest_step_ndc = 0.25;  // a linear model of images reaches no further
inline constexpr double k_still_pixels = 1e-2;      // steps shorter than this change nothing that can be seen

/// A hypothesis at work.
struct Candidate {
  Hypothesis hypothesis;
  NormalEquations equations{};  ///< at the hypothesis, of the level worked on
  double damping = 0;           ///< Marquardt's factor; 0: not linearized at this level yet
  bool is_still = false;        ///< no step at this level gains anything
  bool is_initial = false;      ///< descends from the first pose that was given

  /// Prepares the candidate for another level.
  void restart() { damping = 0, is_still = false; }
};

/// Factor on the number of steps while the best candidate still falls.
inline constexpr unsigned k_patience = 8;

/// The step -(H + damping diag(H))^-1 g; false where H is not positive definite even so.
bool damped_step(const NormalEquations& equations, std::size_t parameters, double damping,
                 PoseSpace::Step& step);
/// Covariance H^-1 S H^-1 of the parameters, S being the scatter of the pixels' gradients: what White 1980
/// and Huber 1967 take for residuals of unequal size, as these are: large at edges, nothing elsewhere.
/// Row-major [parameters]^2; empty where H is not positive definite to rounding.
std::vector<double> covariance(const NormalEquations& equations, std::size_t parameters);

struct Turns {
  unsigned enough, most;
  bool is_end =
      false;  ///< of the work on candidates: what only another turn would need is not found in the last one
  std::optional<double> longer_pixels = {};  ///< after enough turns only longer steps are taken, fall or not
};

/// Turns every candidate until it stands still or often enough, and on as long as the best still falls, or steps are
/// long, all in the same launches. `report` is called after each iteration; false stops. Returns false if it was
/// stopped.
bool refine(PoseLevel& level, const PoseSpace& space, std::vector<Candidate>& candidates, const Turns& turns,
            const std::function<bool()>& report);

}  // namespace dpr
