// Affine maps taken apart and put together: what turns, what stretches, what moves.
#pragma once

#include <glm/glm.hpp>

namespace dpr {

/// A = rotation * stretch; det(rotation) = 1, stretch symmetric (negative definite where A mirrors).
struct Polar {
  glm::dmat3 rotation, stretch;
};

/// `matrix` must be invertible. Higham 1986, Computing the Polar Decomposition, with determinant scaling.
Polar polar_decomposition(const glm::dmat3& matrix);

/// x -> linear x + translation, in the precision of a scene.
glm::mat4 affine(const glm::dmat3& linear, const glm::dvec3& translation);

}  // namespace dpr
