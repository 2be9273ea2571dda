// Surfaces that are seen through.
#pragma once

#include <string>

#include "dpr/mesh.hpp"

namespace dpr {

/// True if it gives opacities of vertices or faces, of whatever size.
bool has_opacities(const Mesh& mesh);
/// True if a texture does.
bool has_texel_opacities(const Mesh& mesh);

/// True if some opacity is below 1.
bool is_see_through(const Mesh& mesh);

/// Throws InvalidArgument for a mesh that is seen through; `where` says what needs an opaque one.
void require_opaque(const Mesh& mesh, const std::string& where);

}  // namespace dpr
