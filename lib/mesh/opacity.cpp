#include "mesh/opacity.hpp"

#include <algorithm>

#include "base/checks.hpp"

namespace dpr {

bool has_opacities(const Mesh& mesh) {
  return !mesh.vertex_opacities.empty() || !mesh.face_opacities.empty();
}

bool is_see_through(const Mesh& mesh) {
  const auto is_below = [](float opacity) { return opacity < 1; };
  return std::ranges::any_of(mesh.vertex_opacities, is_below) ||
         std::ranges::any_of(mesh.face_opacities, is_below);
}

void require_opaque(const Mesh& mesh, const std::string& where) {
  if (is_see_through(mesh))
    throw InvalidArgument(checks::in("opacities", where), "some below 1", "an opaque mesh: 1, or none");
}

}  // namespace dpr
