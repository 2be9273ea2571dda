#include "scene/gradient_table.hpp"

#include <array>

#include "base/checks.hpp"

namespace dpr {
namespace {

using Request = GradientRequest;
using Of = GradientOf;
using G = SceneGradient;
using I = GradientIndex;

constexpr std::array k_names{
    GradientName{"positions", &Request::positions},   GradientName{"colors", &Request::colors},
    GradientName{"transform", &Request::transform},   GradientName{"camera", &Request::camera},
    GradientName{"lights", &Request::lights},         GradientName{"smoothing", &Request::smoothing},
    GradientName{"background", &Request::background}, GradientName{"texture", &Request::texture},
    GradientName{"texcoords", &Request::texcoords}};

bool has_field_of_view(const Scene& scene) { return !scene.camera.intrinsics; }
bool has_intrinsics(const Scene& scene) { return scene.camera.intrinsics.has_value(); }
bool has_lights(const Scene& scene) { return scene.lights.has_value(); }

template <std::size_t k>
GradientArray intrinsic(G& g, I i) {
  return &g.views[i.view].camera.intrinsics[k];
}

/// In the order of a gradient file.
constexpr std::array k_rows{
    GradientRow{&Request::positions, Of::mesh, "meshes[].positions",
                [](G& g, I i) -> GradientArray { return &g.meshes[i.item].positions; }},
    GradientRow{&Request::colors, Of::mesh, "meshes[].colors",
                [](G& g, I i) -> GradientArray { return &g.meshes[i.item].colors; }},
    GradientRow{&Request::texcoords, Of::mesh, "meshes[].texcoords",
                [](G& g, I i) -> GradientArray { return &g.meshes[i.item].texcoords; }},
    GradientRow{&Request::texture, Of::mesh, "meshes[].textures",
                [](G& g, I i) -> GradientArray { return &g.meshes[i.item].textures; }},
    GradientRow{&Request::positions, Of::all_views, "shapes.positions",
                [](G& g, I) -> GradientArray { return &g.shapes.positions; }},
    GradientRow{&Request::colors, Of::all_views, "shapes.colors",
                [](G& g, I) -> GradientArray { return &g.shapes.colors; }},
    GradientRow{&Request::transform, Of::mesh_in_view, "meshes[].rotation",
                [](G& g, I i) -> GradientArray { return &g.views[i.view].transforms[i.item].rotation; }},
    GradientRow{&Request::transform, Of::mesh_in_view, "meshes[].translation",
                [](G& g, I i) -> GradientArray { return &g.views[i.view].transforms[i.item].translation; }},
    GradientRow{&Request::camera, Of::view, "camera.rotation",
                [](G& g, I i) -> GradientArray { return &g.views[i.view].camera.view.rotation; }},
    GradientRow{&Request::camera, Of::view, "camera.translation",
                [](G& g, I i) -> GradientArray { return &g.views[i.view].camera.view.translation; }},
    GradientRow{&Request::camera, Of::view, "camera.fov_y_degrees",
                [](G& g, I i) -> GradientArray { return &g.views[i.view].camera.fov_y_degrees; },
                has_field_of_view},
    GradientRow{&Request::camera, Of::view, "camera.intrinsics.fx", intrinsic<0>, has_intrinsics},
    GradientRow{&Request::camera, Of::view, "camera.intrinsics.fy", intrinsic<1>, has_intrinsics},
    GradientRow{&Request::camera, Of::view, "camera.intrinsics.cx", intrinsic<2>, has_intrinsics},
    GradientRow{&Request::camera, Of::view, "camera.intrinsics.cy", intrinsic<3>, has_intrinsics},
    GradientRow{&Request::lights, Of::scene, "lights.ambient",
                [](G& g, I) -> GradientArray { return &g.ambient; }, has_lights},
    GradientRow{&Request::lights, Of::light, "lights.point[].position",
                [](G& g, I i) -> GradientArray { return &g.lights[i.item].position; }, has_lights},
    GradientRow{&Request::lights, Of::light, "lights.point[].diffuse",
                [](G& g, I i) -> GradientArray { return &g.lights[i.item].diffuse; }, has_lights},
    GradientRow{&Request::lights, Of::light, "lights.point[].specular",
                [](G& g, I i) -> GradientArray { return &g.lights[i.item].specular; }, has_lights},
    GradientRow{&Request::smoothing, Of::scene, "sigma", [](G& g, I) -> GradientArray { return &g.sigma; }},
    GradientRow{&Request::smoothing, Of::scene, "gamma", [](G& g, I) -> GradientArray { return &g.gamma; }},
    GradientRow{&Request::smoothing, Of::scene, "alpha", [](G& g, I) -> GradientArray { return &g.alpha; }},
    GradientRow{&Request::background, Of::scene, "background",
                [](G& g, I) -> GradientArray { return &g.background; }}};

}  // namespace

std::span<const GradientName> gradient_names() { return k_names; }

std::span<const GradientRow> gradient_rows() { return k_rows; }

GradientRequest no_gradients() {
  GradientRequest request;
  for (const GradientName& name : k_names) request.*name.wanted = false;
  return request;
}

GradientIndex count_arrays(const GradientRow& row, const SceneGradient& gradient) {
  const std::size_t views = gradient.views.size();
  switch (row.of) {
    case GradientOf::scene:
    case GradientOf::all_views:
      return {1, 1};
    case GradientOf::mesh:
      return {1, gradient.meshes.size()};
    case GradientOf::light:
      return {1, gradient.lights.size()};
    case GradientOf::view:
      return {views, 1};
    case GradientOf::mesh_in_view:
      return {views, views > 0 ? gradient.views.front().transforms.size() : 0};
  }
  return {};
}

std::string name_of(const GradientRow& row, GradientIndex index) {
  std::string name(row.path);
  if (const std::size_t list = name.find("[]"); list != std::string::npos)
    name.insert(list + 1, std::to_string(index.item));
  const bool is_of_one_view = row.of == GradientOf::view || row.of == GradientOf::mesh_in_view;
  return is_of_one_view ? checks::element("views", index.view) + "." + name : name;
}

}  // namespace dpr
