// Lists of candidates.
#include "solve/pose_candidates.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>

namespace dpr {

bool by_loss(const Candidate& a, const Candidate& b) { return a.equations.loss < b.equations.loss; }

std::vector<Hypothesis> hypotheses_of(std::span<const Candidate> candidates) {
  std::vector<Hypothesis> result;
  for (const Candidate& candidate : candidates) result.push_back(candidate.hypothesis);
  return result;
}

std::vector<Candidate> distinct(std::vector<Candidate> candidates, const PoseSpace& space, double ndc,
                                std::size_t count) {
  std::ranges::stable_sort(candidates, by_loss);
  std::vector<Candidate> kept;
  for (const Candidate& candidate : candidates) {
    const auto same = std::ranges::find_if(kept, [&](const Candidate& other) {
      return space.distance(candidate.hypothesis, other.hypothesis) < ndc;
    });
    if (same != kept.end()) {
      same->is_initial = same->is_initial || candidate.is_initial;
    } else if (kept.size() < count || candidate.is_initial) {
      kept.push_back(candidate);
    }
  }
  return kept;
}

void drop_hopeless(std::vector<Candidate>& candidates, std::size_t first, const Hope& hope,
                   double wrong_loss) {
  const double least = std::ranges::min_element(candidates, by_loss)->equations.loss;
  const auto is_hopeless = [&](const Candidate& c) {
    return !c.is_initial && c.equations.loss > hope.ratio * least + hope.part * wrong_loss;
  };
  const auto begin = candidates.begin() + static_cast<std::ptrdiff_t>(first);
  candidates.erase(std::remove_if(begin, candidates.end(), is_hopeless), candidates.end());
}

bool is_doubtful(std::span<const Candidate> candidates, const PoseSpace& space, double equal, double other) {
  constexpr double k_nearly = 1.25,
                   k_other = 0.2;  // of the object's radius, by which another pose moves its rim
  const Candidate& best = candidates.front();
  return std::ranges::any_of(candidates, [&](const Candidate& c) {
    return c.equations.loss > equal && c.equations.loss - other < k_nearly * (best.equations.loss - other) &&
           space.distance(c.hypothesis, best.hypothesis) > k_other * space.radius_ndc();
  });
}

std::array<glm::dmat3, 3> half_turns(std::span<const glm::dvec3> points) {
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const glm::dvec3& p : points) {
    const Eigen::Vector3d v(p.x, p.y, p.z);
    spread += v * v.transpose();
  }
  const Eigen::Matrix3d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors();
  std::array<glm::dmat3, 3> turns;
  for (std::size_t i = 0; i < turns.size(); ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    const glm::dvec3 axis(axes(0, column), axes(1, column), axes(2, column));
    turns[i] = 2.0 * glm::outerProduct(axis, axis) - glm::dmat3(1.0);
  }
  return turns;
}

}  // namespace dpr
