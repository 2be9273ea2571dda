// What makes lights that can be rendered with.
#include "dpr/light.hpp"

#include "base/checks.hpp"

namespace dpr {

void validate(const Lights& lights) {
  checks::require_finite(lights.ambient, "ambient (lights)");
  for (std::size_t i = 0; i < lights.point.size(); ++i) {
    const std::string where = checks::element("lights.point", i);
    checks::require_finite(lights.point[i].position, checks::in("position", where));
    checks::require_finite(lights.point[i].diffuse, checks::in("diffuse", where));
    checks::require_finite(lights.point[i].specular, checks::in("specular", where));
  }
  if (!(lights.shininess >= 1 && std::isfinite(lights.shininess))) {
    throw InvalidArgument("shininess (lights)", checks::text(lights.shininess), "a finite number >= 1");
  }
  switch (lights.shading) {
    case Shading::flat:
    case Shading::phong:
    case Shading::gouraud:
      return;
  }
  throw InvalidArgument("shading (lights)", std::to_string(static_cast<int>(lights.shading)),
                        "flat, phong or gouraud");
}

}  // namespace dpr
