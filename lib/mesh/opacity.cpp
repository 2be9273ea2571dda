#include "mesh/opacity.hpp"

#include <algorithm>

#include "base/checks.hpp"

namespace dpr {

bool has_opacities(const Mesh& mesh) {
  return !mesh.vertex_opacities.empty() || !mesh.face_opacities.empty();
}

bool has_texel_opacities(const Mesh& mesh) {
  return std::ranges::any_of(mesh.textures, [](const Texture& t) { return !t.opacities.empty(); });
}

bool is_see_through(const Mesh& mesh) {
  const auto has_below = [](const std::vector<float>& opacities) {
    return std::ranges::any_of(opacities, [](float opacity) { return opacity < 1; });
  };
  return has_below(mesh.vertex_opacities) || has_below(mesh.face_opacities) ||
         std::ranges::any_of(mesh.textures, has_below, &Texture::opacities);
}

void require_opaque(const Mesh& mesh, const std::string& where) {
  if (is_see_through(mesh))
    throw InvalidArgument(checks::in("opacities", where), "some below 1",
                          "an opaque mesh: 1, or none, of its textures too");
}

}  // namespace dpr
