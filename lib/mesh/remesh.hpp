// Triangles of one size.
#pragma once

#include <optional>

#include "dpr/mesh.hpp"

namespace dpr {

/// The surface with edges of about that length: isotropic remeshing (Botsch & Kobbelt 2004) by `passes` of
/// splitting edges above 4/3 of it, collapsing those below 4/5, flipping towards valence six and moving
/// vertices within the surface. Vertex colours are interpolated; face colours and texture coordinates are
/// left behind. Nothing where the mesh is not manifold: OpenMesh takes no other. Throws InvalidArgument where
/// the surface would need more than 2^22 triangles.
std::optional<Mesh> remesh(const Mesh& mesh, float edge_length, unsigned passes = 3);

}  // namespace dpr
