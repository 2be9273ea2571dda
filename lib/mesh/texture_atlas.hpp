// Texture coordinates for a mesh that has none.
#pragma once

#include "dpr/mesh.hpp"

namespace dpr {

/// The mesh with a square texture of that side in the place of its colours, which it shows: two triangles share a
/// square of texels, and no texel counts for both, even where it is interpolated. Throws InvalidArgument where these
/// squares would be smaller than 4x4 texels, or the side is above 16384. O(faces + texels).
Mesh with_atlas(Mesh mesh, int side);

}  // namespace dpr
