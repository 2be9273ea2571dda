// The light that a hypothesis is seen in: linear in what its image is made of, so that the best one is known
// in closed form.
#pragma once

#include <Eigen/Core>
#include <glm/glm.hpp>

#include "dpr/mesh.hpp"

namespace dpr {

/// Sums over the pixels, weighed, of the least squares of a channel's light (kernels/normal_equations.cl). The
/// unknowns are what multiplies the polynomials of the normal, of which the first is 1, and what is reflected
/// whatever the colour.
struct LightSums {
  Eigen::MatrixXd normal;  ///< products of the terms
  Eigen::VectorXd sum, right;
};

struct ChannelLight {
  Eigen::VectorXd light;
  Eigen::MatrixXd inverse;  ///< of the normal matrix, the prior's included
  double prior_loss = 0;    ///< summed, like that of pixels
  double seen = 0;          ///< weighed sum of squared coverages
};

/// The light that explains the target best. A prior holds its directional part, and what does not depend on
/// the colour, near 0 where the picture says little of them. Rotations map the harmonics of an order onto
/// themselves: the object's own normals will do.
ChannelLight solve_light(const LightSums& sums);

/// Normals of corners where the mesh gives none: the mean over those faces at their vertex that
/// no sharp edge parts from theirs, or over all.
enum class CornerNormals { parted, smooth };

/// Gives the mesh unit normals of each corner of each face, after `stretch`: those of a surface without extent are 0.
void give_normals(Mesh& mesh, const glm::dmat3& stretch, CornerNormals normals);

}  // namespace dpr
