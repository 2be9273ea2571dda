// The hypotheses on their way through the levels: which are the same, which are given up, which are added.
#pragma once

#include <array>
#include <cstddef>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "dpr/scene.hpp"
#include "solve/levenberg_marquardt.hpp"

namespace dpr {

bool by_loss(const Candidate& a, const Candidate& b);

std::vector<Hypothesis> hypotheses_of(std::span<const Candidate> candidates);

/// The best `count` that differ, by their losses; of those that move the object's rim by less than `ndc`
/// against each other the best. The initial one stays in any case: it may be the nearest of many equals.
std::vector<Candidate> distinct(std::vector<Candidate> candidates, const PoseSpace& space, double ndc,
                                std::size_t count);

/// Candidates are given up where their loss is beyond this multiple of the best one and, besides, this part
/// of what a wrong pose leaves: the best may fit its pixels by luck.
struct Hope {
  double ratio, part;
};

/// Gives up those from the `first` on, but not the initial one: coarse levels that tell little of the light may
/// judge it wrong. At least one candidate.
void drop_hopeless(std::vector<Candidate>& candidates, std::size_t first, const Hope& hope,
                   double wrong_loss);

/// True if another pose leaves less than a quarter more than the best, the first, yet more than `equal`: either may
/// be right. Of all losses, the best's parts of `other` say nothing against it.
bool is_doubtful(std::span<const Candidate> candidates, const PoseSpace& space, double equal,
                 double other = 0);

/// Rotations by half a turn about each of the axes of inertia of an object with these points, through its origin: what
/// many an object looks much the same after.
std::array<glm::dmat3, 3> half_turns(std::span<const glm::dvec3> points);

}  // namespace dpr
