// Normals of a mesh's vertices, for shading of the caller's own.
#pragma once

#include <span>
#include <vector>

#include "dpr/export.h"
#include "dpr/vectors.hpp"

namespace dpr {

/// Unit normals [vertex], in the positions' space: means of those of the faces around a vertex, weighted by area, as
/// lights have them; 0 where no face has one. Works on the host; O(vertices + faces). Throws InvalidArgument for
/// positions that are not finite, and indices beyond them.
DPR_API std::vector<vec3> vertex_normals(std::span<const vec3> positions, std::span<const uvec3> faces);
/// The gradient of <grad, vertex_normals()> by the positions.
DPR_API std::vector<vec3> vertex_normals_backward(std::span<const vec3> positions,
                                                  std::span<const uvec3> faces, std::span<const vec3> grad);

}  // namespace dpr
