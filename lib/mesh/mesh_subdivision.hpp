// A mesh's subdivision, from the pieces of its faces.
#pragma once

#include <span>

#include "dpr/subdivision.hpp"
#include "mesh/face_pieces.hpp"

namespace dpr {

/// Subdivides a valid mesh. `computed_normals` is the member of MeshSubdivision; 0 for a mesh with normals.
MeshSubdivision make_subdivision(const Mesh& mesh, std::span<const FacePiece> pieces, int computed_normals);

}  // namespace dpr
