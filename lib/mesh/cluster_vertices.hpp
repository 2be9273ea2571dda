// A mesh with fewer triangles, for images that would not show the rest.
#pragma once

#include "dpr/mesh.hpp"

namespace dpr {

/// Vertex clustering (Rossignac & Borrel 1993): the vertices in a cube of side `cell` (> 0, object space)
/// become one at their mean position, with their mean colour; triangles with two equal corners then, and
/// further ones with the same three, are left out. Normals that the mesh gives are not kept. Returns the mesh
/// as it is where no triangle would be left. O(n log n); the same mesh every time.
Mesh cluster_vertices(const Mesh& mesh, float cell);

}  // namespace dpr
