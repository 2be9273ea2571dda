// Normals of vertices in double precision, as sums over faces and as directions.
#pragma once

#include "dpr/vertex_normals.hpp"

namespace dpr {

/// Sums of the normals of the faces around vertices, twice their area long.
std::vector<dvec3> normal_sums(std::span<const vec3> positions, std::span<const uvec3> faces);
/// The gradient of <grad, normal_sums()> by the positions.
std::vector<dvec3> normal_sums_backward(std::span<const vec3> positions, std::span<const uvec3> faces,
                                        std::span<const dvec3> grad);

/// The unit vector along a normal, or 0 if the normal is 0.
dvec3 direction_of(const dvec3& normal);
/// The gradient of <grad, direction_of()> by the normal.
dvec3 direction_backward(const dvec3& normal, const dvec3& grad);

}  // namespace dpr
