// How far the score of a pose scatters: what its covariance rests on.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "solve/normal_equations.hpp"

namespace dpr {

/// Covariance of the gradient, in place of the plain sum over pixels, of two parts:
///
/// - Noise. Neighbours' residuals go together: scores are added up over blocks before their outer products are
///   (Liang and Zeger 1986; Conley 1999 for pixels), over blocks of one, two and four cells on a side, each corrected
///   for the parameters that were fitted to so few blocks; or the scatter by pixels counts as often as squares of
///   the residuals' sums over blocks say that pixels go together. Whichever is largest holds, twice, which is
///   what errors of poses in pictures with independent noise say (tests/solve/pose_uncertainty_test.cpp).
/// - The model's error. What is wrong about light, surface and outline repeats from block to block, and the fit has
///   taken up most of what speaks of the pose before residuals show the rest. Its part of the scatter is what the
///   residuals' median does not explain as noise, or with a robust loss what has lost its weight; it counts as
///   many times as errors of poses in pictures by other software have it (bench/results/notes.md).
///
/// `scale`: of the robust loss; 0: squares. Row-major [parameters]^2.
PoseSpace::Matrix score_scatter(const ScoreCells& cells, std::size_t parameters, float scale);

/// Turns a covariance of motions about a point into that of motions about one that lies `arm` away, world: a rotation
/// moves that by its cross product.
void move_pivot(const glm::dvec3& arm, std::vector<double>& covariance);

}  // namespace dpr
