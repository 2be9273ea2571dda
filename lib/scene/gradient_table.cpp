#include "scene/gradient_table.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include "base/checks.hpp"
#include "base/name_list.hpp"
#include "scene/lens.hpp"
#include "scene/light_table.hpp"

namespace dpr {
namespace {

using Request = GradientRequest;
using Of = GradientOf;
using G = SceneGradient;
using I = GradientIndex;

constexpr std::array k_gradient_names{GradientName{"positions", &Request::positions},
                                      GradientName{"colors", &Request::colors},
                                      GradientName{"transform", &Request::transform},
                                      GradientName{"camera", &Request::camera},
                                      GradientName{"lights", &Request::lights},
                                      GradientName{"smoothing", &Request::smoothing},
                                      GradientName{"background", &Request::background},
                                      GradientName{"texture", &Request::texture},
                                      GradientName{"texcoords", &Request::texcoords},
                                      GradientName{"distortion", &Request::distortion},
                                      GradientName{"normals", &Request::normals},
                                      GradientName{"materials", &Request::materials},
                                      GradientName{"opacities", &Request::opacities},
                                      GradientName{"texel_opacities", &Request::texel_opacities}};

bool has_field_of_view(const Scene& scene) {
  return !scene.camera.intrinsics && !scene.camera.orthographic_height;
}
bool has_intrinsics(const Scene& scene) { return scene.camera.intrinsics.has_value(); }
bool has_fisheye(const Scene& scene) { return is_fisheye(scene.camera); }
bool has_distortion(const Scene& scene) { return scene.camera.distortion && !has_fisheye(scene); }
bool is_orthographic(const Scene& scene) { return scene.camera.orthographic_height.has_value(); }
bool has_lights(const Scene& scene) { return scene.lights.has_value(); }
bool has_harmonics(const Scene& scene) { return has_lights(scene) && !scene.lights->harmonics.empty(); }

template <auto array>
GradientArray of_mesh(G& g, I i) {
  return &(g.meshes[i.item].*array);
}

template <std::size_t k>
GradientArray intrinsic(G& g, I i) {
  return &g.views[i.view].camera.intrinsics[k];
}

template <std::size_t k>
GradientArray coefficient(G& g, I i) {
  return &g.views[i.view].camera.distortion[k];
}

template <std::size_t k>
GradientArray of_fisheye(G& g, I i) {
  return &g.views[i.view].camera.fisheye[k];
}

/// Rows of a kind of light. Files have the list of point lights even where there are none.
template <typename Kind>
void add_rows(Kind, std::vector<GradientRow>& rows) {
  const auto exists = [](const Scene& scene) {
    return has_lights(scene) && (Kind::needs == 0 || !((*scene.lights).*Kind::lights).empty());
  };
  const auto count = [](const SceneGradient& gradient) { return (gradient.*Kind::gradients).size(); };
  Kind::for_each_member([&](std::string_view key, auto, auto member, auto...) {
    const auto array = [member](G& g, I i) -> GradientArray {
      return &((g.*Kind::gradients)[i.item].*member);
    };
    rows.push_back(
        {&Request::lights, Of::light, list_of(Kind()) + "[]." + std::string(key), array, exists, count});
  });
}

/// In the order of a gradient file.
std::vector<GradientRow> make_rows() {
  std::vector<GradientRow> rows{
      GradientRow{&Request::positions, Of::mesh, "meshes[].positions", of_mesh<&MeshGradient::positions>},
      GradientRow{&Request::colors, Of::mesh, "meshes[].colors", of_mesh<&MeshGradient::colors>},
      GradientRow{&Request::texcoords, Of::mesh, "meshes[].texcoords", of_mesh<&MeshGradient::texcoords>},
      GradientRow{&Request::texture, Of::mesh, "meshes[].textures", of_mesh<&MeshGradient::textures>},
      GradientRow{&Request::normals, Of::mesh, "meshes[].normals", of_mesh<&MeshGradient::normals>},
      GradientRow{&Request::materials, Of::mesh, "meshes[].specular", of_mesh<&MeshGradient::specular>},
      GradientRow{&Request::materials, Of::mesh, "meshes[].shininess", of_mesh<&MeshGradient::shininess>},
      GradientRow{&Request::opacities, Of::mesh, "meshes[].opacities", of_mesh<&MeshGradient::opacities>},
      GradientRow{&Request::texel_opacities, Of::mesh, "meshes[].texel_opacities",
                  of_mesh<&MeshGradient::texel_opacities>},
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
      GradientRow{&Request::camera, Of::view, "camera.orthographic_height",
                  [](G& g, I i) -> GradientArray { return &g.views[i.view].camera.orthographic_height; },
                  is_orthographic},
      GradientRow{&Request::distortion, Of::view, "camera.distortion.k1", coefficient<0>, has_distortion},
      GradientRow{&Request::distortion, Of::view, "camera.distortion.k2", coefficient<1>, has_distortion},
      GradientRow{&Request::distortion, Of::view, "camera.distortion.p1", coefficient<2>, has_distortion},
      GradientRow{&Request::distortion, Of::view, "camera.distortion.p2", coefficient<3>, has_distortion},
      GradientRow{&Request::distortion, Of::view, "camera.distortion.k3", coefficient<4>, has_distortion},
      GradientRow{&Request::distortion, Of::view, "camera.fisheye.k1", of_fisheye<0>, has_fisheye},
      GradientRow{&Request::distortion, Of::view, "camera.fisheye.k2", of_fisheye<1>, has_fisheye},
      GradientRow{&Request::distortion, Of::view, "camera.fisheye.k3", of_fisheye<2>, has_fisheye},
      GradientRow{&Request::distortion, Of::view, "camera.fisheye.k4", of_fisheye<3>, has_fisheye},
      GradientRow{&Request::lights, Of::scene, "lights.ambient",
                  [](G& g, I) -> GradientArray { return &g.ambient; }, has_lights},
      GradientRow{&Request::lights, Of::scene, "lights.harmonics",
                  [](G& g, I) -> GradientArray { return &g.harmonics; }, has_harmonics}};
  for_each_light_kind([&](auto kind) { add_rows(kind, rows); });
  rows.insert(rows.end(), {GradientRow{&Request::smoothing, Of::scene, "sigma",
                                       [](G& g, I) -> GradientArray { return &g.sigma; }},
                           GradientRow{&Request::smoothing, Of::scene, "gamma",
                                       [](G& g, I) -> GradientArray { return &g.gamma; }},
                           GradientRow{&Request::smoothing, Of::scene, "alpha",
                                       [](G& g, I) -> GradientArray { return &g.alpha; }},
                           GradientRow{&Request::background, Of::scene, "background",
                                       [](G& g, I) -> GradientArray { return &g.background; }}});
  return rows;
}

}  // namespace

std::span<const GradientName> gradient_names() { return k_gradient_names; }

bool GradientRequest::*parse_gradient(std::string_view word, const std::string& argument) {
  std::array<std::string_view, k_gradient_names.size()> words;
  std::ranges::transform(k_gradient_names, words.begin(), &GradientName::word);
  return k_gradient_names[position_of(word, words, argument)].wanted;
}

std::span<const GradientRow> gradient_rows() {
  static const std::vector<GradientRow> rows = make_rows();
  return rows;
}

GradientRequest no_gradients() {
  GradientRequest request;
  for (const GradientName& name : k_gradient_names) request.*name.wanted = false;
  return request;
}

bool exists(const GradientRow& row, GradientIndex index, const Scene& scene, std::span<const View> views) {
  if (!row.exists) return true;
  if (row.of != GradientOf::view) return row.exists(scene);
  Scene seen;
  seen.camera = views[index.view].camera;
  return row.exists(seen);
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
      return {1, row.lights(gradient)};
    case GradientOf::view:
      return {views, 1};
    case GradientOf::mesh_in_view:
      return {views, views > 0 ? gradient.views.front().transforms.size() : 0};
  }
  return {};
}

void add_numbers(const GradientArray& to, const GradientArray& from) {
  std::vector<double> sum, added;
  const auto append_to = [](std::vector<double>& list) {
    return [&list](double value) { return list.emplace_back(value); };
  };
  transform_numbers(to, append_to(sum));
  transform_numbers(from, append_to(added));
  if (added.empty()) return;
  if (sum.empty()) {
    std::visit([&](auto* list) { *list = *std::get<decltype(list)>(from); }, to);
    return;
  }
  if (sum.size() != added.size()) {
    throw InvalidArgument("gradient (add)", std::to_string(added.size()) + " numbers",
                          std::to_string(sum.size()) + ", those of the same array");
  }
  auto value = added.begin();
  transform_numbers(to, [&](double number) { return number + *value++; });
}

void add(SceneGradient& to, const SceneGradient& from) {
  SceneGradient sum = to, added = from;
  for_each_light_kind([&](auto kind) {
    auto& lights = sum.*kind.gradients;
    if (lights.empty()) lights.resize((added.*kind.gradients).size());
  });
  for (const GradientRow& row : gradient_rows()) {
    const GradientIndex has = count_arrays(row, sum), more = count_arrays(row, added);
    if ((row.lights && more.item == 0) || (has.view == more.view && has.item == more.item)) continue;
    throw InvalidArgument("gradient (add)", std::to_string(more.view * more.item) + " of " + row.path,
                          std::to_string(has.view * has.item) + ": the gradient of the same scene and views");
  }
  for_each_array(added, [&](const GradientRow& row, GradientIndex i, const GradientArray& array) {
    add_numbers(row.array(sum, i), array);
  });
  to = std::move(sum);
}

std::string name_of(const GradientRow& row, GradientIndex index) {
  std::string name(row.path);
  if (const std::size_t list = name.find("[]"); list != std::string::npos)
    name.insert(list + 1, std::to_string(index.item));
  const bool is_of_one_view = row.of == GradientOf::view || row.of == GradientOf::mesh_in_view;
  return is_of_one_view ? checks::element("views", index.view) + "." + name : name;
}

namespace {

/// Adds the gradients of chunks, which come in their order, in double precision.
class GradientSum {
 public:
  void add_chunk(SceneGradient&& chunk) {
    std::size_t next = 0;
    for_each_array(chunk, [&](const GradientRow& row, GradientIndex, const GradientArray& array) {
      if (is_per_view(row.of)) return;
      if (next == sums_.size()) sums_.emplace_back();
      add(sums_[next++], array);
    });
    std::ranges::move(chunk.views, std::back_inserter(views_));
    last_ = std::move(chunk);
  }

  SceneGradient finish() {
    std::size_t next = 0;
    for_each_array(last_, [&](const GradientRow& row, GradientIndex, const GradientArray& array) {
      if (is_per_view(row.of)) return;
      auto value = sums_[next++].begin();
      transform_numbers(array, [&](double) { return *value++; });
    });
    last_.views = std::move(views_);
    return std::move(last_);
  }

 private:
  static void add(std::vector<double>& sum, const GradientArray& array) {
    std::size_t i = 0;
    transform_numbers(array, [&](double value) {
      if (i == sum.size()) sum.push_back(0.0);
      sum[i++] += value;
      return value;
    });
  }

  std::vector<std::vector<double>> sums_;  // [array that is a sum over the views]
  std::vector<ViewGradient> views_;
  SceneGradient last_;
};

[[noreturn]] void refuse_gradient(const std::string& name, double value) {
  throw InvalidArgument("gradient of " + name + " (backward)", checks::text(value),
                        "a finite number; the scene's lengths or the smoothing are beyond single precision");
}

}  // namespace

SceneGradient sum_of(std::vector<SceneGradient>&& parts) {
  if (parts.size() == 1) return std::move(parts.front());
  GradientSum sum;
  for (SceneGradient& part : parts) sum.add_chunk(std::move(part));
  return sum.finish();
}

void require_finite(SceneGradient& gradient) {
  for_each_array(gradient, [](const GradientRow& row, GradientIndex index, const GradientArray& array) {
    const auto check_vectors = [&]<class Vector>(std::span<const Vector> vectors) {  // millions, perhaps
      const std::span<const float> numbers = checks::floats_of(vectors);
      const std::size_t place = checks::first_not_finite(numbers);
      if (place == numbers.size()) return;
      const std::size_t element = place / static_cast<std::size_t>(Vector::length());
      refuse_gradient(checks::element(name_of(row, index), element), static_cast<double>(numbers[place]));
    };
    if (const auto* of_three = std::get_if<std::vector<glm::vec3>*>(&array))
      return check_vectors(std::span<const glm::vec3>(**of_three));
    if (const auto* of_two = std::get_if<std::vector<glm::vec2>*>(&array))
      return check_vectors(std::span<const glm::vec2>(**of_two));
    transform_numbers(array, [&](double value) {
      if (!std::isfinite(value)) refuse_gradient(name_of(row, index), value);
      return value;
    });
  });
}

}  // namespace dpr
