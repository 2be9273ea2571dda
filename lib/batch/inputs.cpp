#include "batch/inputs.hpp"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "base/checks.hpp"
#include "base/name_list.hpp"
#include "dpr/error.hpp"
#include "scene/light_table.hpp"

namespace dpr::batch {
namespace {

constexpr std::array<std::string_view, 3> k_numbers{"sigma", "gamma", "alpha"};
constexpr std::string_view k_texture = "textures[";

std::vector<std::string_view> light_names() {
  std::vector<std::string_view> names{"ambient", "harmonics"};
  for_each_light_kind([&](auto kind) { names.push_back(kind.key); });
  return names;
}

/// Number of a light's values, by kind.
template <typename Kind>
std::size_t count_numbers(Kind) {
  std::size_t count = 0;
  const typename Kind::Light light;
  Kind::for_each_member([&](std::string_view key, auto member, auto...) {
    visit_numbers(key, light.*member, [&](std::string_view, float) { ++count; });
  });
  return count;
}

/// True for the name of an array; textures are counted.
bool is_name(const std::string& name, std::size_t textures) {
  static constexpr std::array<std::string_view, 5> k_without_gradients{"faces", "views", "face_texcoords",
                                                                       "face_textures", "face_materials"};
  if (std::ranges::find(k_without_gradients, name) != k_without_gradients.end()) return true;
  if (!name.starts_with(k_texture)) return !gradient_rows_of(name).empty();
  std::size_t i = 0;
  while (i < textures && name != texture_name(i)) ++i;
  return i < textures;
}

// Numbers of a view's projection: the height of an orthographic one, the intrinsics, or these and the
// coefficients of the lens.
constexpr std::size_t k_orthographic = 1, k_pinhole = 4, k_fisheye = 8, k_brown = 9;

void set_projection(Camera& camera, std::span<const float> k) {
  if (k.size() == k_orthographic) {
    camera.orthographic_height = k[0];
    return;
  }
  camera.intrinsics = Intrinsics{k[0], k[1], k[2], k[3]};
  if (k.size() == k_brown) camera.distortion = Distortion{k[4], k[5], k[6], k[7], k[8]};
  if (k.size() == k_fisheye) camera.distortion = fisheye(k[4], k[5], k[6], k[7]);
}

/// [view][n][3] or [n][3]: as many as `views`, or one.
void require_batch(const NamedArray& array, std::size_t views, std::size_t count, const std::string& letter) {
  require_form(array, Element::float32, {{count, 3}, {k_any, count, 3}},
               "[" + letter + ", 3] or [N, " + letter + ", 3]");
  if (array.shape.size() == 2 || array.shape[0] == 1 || array.shape[0] == views) return;
  throw InvalidArgument(argument(array), text_of(array.shape),
                        "1 or " + std::to_string(views) + ", one a view, in the first dimension");
}

/// Throws InvalidArgument unless arrays go with faces of every one of `views` views by itself.
void require_own_arrays(NamedArrays arrays, std::size_t views) {
  for (const NamedArray& array : arrays) {
    static constexpr std::array<std::string_view, 6> k_by_view{"faces",       "vertices",  "colors",
                                                               "face_colors", "opacities", "face_opacities"};
    if (std::ranges::find(k_by_view, array.name) == k_by_view.end()) continue;
    const std::size_t dimensions = array.name.ends_with("opacities") ? 2 : 3;
    if (array.shape.size() != dimensions || array.shape[0] != views)
      throw InvalidArgument(argument(array), text_of(array.shape),
                            "[" + std::to_string(views) + ", ...], as faces are of every view by itself");
  }
}

}  // namespace

std::string texture_name(std::size_t index) { return checks::element("textures", index); }

std::size_t count_textures(NamedArrays arrays) {
  std::size_t count = 0;
  while (find(arrays, texture_name(count))) ++count;
  return count;
}

FaceSizes sizes_of(const NamedArray& faces) {
  const std::vector<std::size_t>& shape = faces.shape;
  if (shape.size() < 2) return {1, shape.empty() ? 0 : shape[0]};
  return {shape.size() > 2 ? std::max<std::size_t>(shape[0], 1) : 1, shape[shape.size() - 2]};
}

std::vector<const GradientRow*> gradient_rows_of(std::string_view name) {
  using Path = std::pair<std::string_view, std::string_view>;  // an array's name, what paths begin with
  static constexpr std::array k_paths{Path{"vertices", "meshes[].positions"},
                                      Path{"vertices", "shapes.positions"},
                                      Path{"colors", "meshes[].colors"},
                                      Path{"colors", "shapes.colors"},
                                      Path{"face_colors", "meshes[].colors"},
                                      Path{"face_colors", "shapes.colors"},
                                      Path{"texcoords", "meshes[].texcoords"},
                                      Path{"materials.specular", "meshes[].specular"},
                                      Path{"materials.shininess", "meshes[].shininess"},
                                      Path{"opacities", "meshes[].opacities"},
                                      Path{"face_opacities", "meshes[].opacities"},
                                      Path{"intrinsics", "camera.intrinsics."},
                                      Path{"intrinsics", "camera.distortion."},
                                      Path{"intrinsics", "camera.fisheye."},
                                      Path{"intrinsics", "camera.orthographic_height"},
                                      Path{"background", "background"},
                                      Path{"sigma", "sigma"},
                                      Path{"gamma", "gamma"},
                                      Path{"alpha", "alpha"}};
  std::vector<const GradientRow*> rows;
  const bool is_light = name.starts_with("lights.");
  for (const GradientRow& row : gradient_rows()) {
    const std::string_view path = row.path, list = path.substr(0, path.find("[]"));
    const auto has = [&](const Path& known) { return known.first == name && path.starts_with(known.second); };
    if (std::ranges::any_of(k_paths, has) || (is_light && list == name) ||
        (name.starts_with(k_texture) && (path == "meshes[].textures" || path == "meshes[].texel_opacities")))
      rows.push_back(&row);
  }
  return rows;
}

bool has_alpha(const NamedArray& texture) { return texture.shape.back() == 4; }

const NamedArray* find_colors(NamedArrays arrays) {
  const NamedArray* const colors = find(arrays, "colors");
  return colors ? colors : find(arrays, "face_colors");
}

const NamedArray* find_opacities(NamedArrays arrays) {
  const NamedArray* const opacities = find(arrays, "opacities");
  return opacities ? opacities : find(arrays, "face_opacities");
}

BatchSizes check_sizes(NamedArrays arrays) {
  const std::size_t textures = count_textures(arrays);
  for (const NamedArray& array : arrays) {
    if (!is_name(array.name, textures)) {
      const std::vector<std::string_view> lights = light_names();
      if (array.name.starts_with("lights."))
        throw InvalidArgument("lights (batch)", "'" + array.name.substr(7) + "'", one_of(lights));
      if (array.name.starts_with("materials."))
        throw InvalidArgument("materials (batch)", "'" + array.name.substr(10) + "'",
                              "specular or shininess");
      throw InvalidArgument("array (batch)", "\"" + array.name + "\"", "a name of dpr/dpr_frame.h");
    }
  }
  const NamedArray& views = require(arrays, "views");
  require_floats(views, {k_any, 4, 4}, "[N, 4, 4]");
  const std::size_t count = views.shape[0];
  if (count == 0) throw InvalidArgument(argument(views), text_of(views.shape), "at least one view");
  const NamedArray& vertices = require(arrays, "vertices");
  require_batch(vertices, count, k_any, "V");
  const std::size_t of_mesh = vertices.shape[vertices.shape.size() - 2];
  const std::string rows = std::to_string(count);
  require_form(require(arrays, "intrinsics"), Element::float32,
               {{count, k_pinhole}, {count, k_brown}, {count, k_fisheye}, {count, k_orthographic}},
               "[" + rows + ", 4], [" + rows + ", 9], [" + rows + ", 8] or [" + rows + ", 1]");
  if (const NamedArray* const background = find(arrays, "background"))
    require_floats(*background, {3}, "[3]");
  if (find(arrays, "colors") && find(arrays, "face_colors"))
    throw InvalidArgument("colors (batch)", "colors and face_colors", "one of them");
  if (const NamedArray* const colors = find(arrays, "colors"))
    require_batch(*colors, count, of_mesh, std::to_string(of_mesh));
  const FaceSizes faces = sizes_of(require(arrays, "faces"));
  if (const NamedArray* const colors = find(arrays, "face_colors"))
    require_batch(*colors, count, faces.count, std::to_string(faces.count));
  if (faces.views > 1) require_own_arrays(arrays, count);
  return {count, of_mesh, faces.views};
}

std::vector<View> make_views(NamedArrays arrays, const RenderSettings& settings) {
  const NamedArray &matrices = require(arrays, "views"), &intrinsics = require(arrays, "intrinsics"),
                   &vertices = require(arrays, "vertices");
  const std::size_t count = matrices.shape[0], numbers = intrinsics.shape[1];
  const auto positions = vertices.rows<const glm::vec3>();
  const std::size_t of_mesh = vertices.shape[vertices.shape.size() - 2];
  const bool is_own = positions.size() > of_mesh;
  std::optional<BoxCorners> box;  // of the vertices; none: no planes are set by them
  std::vector<View> views;
  for (std::size_t v = 0; v < count; ++v) {
    View view{{}, {glm::mat4(1.0F)}};
    if (of_mesh > 0 && !settings.has_clipping() && (v == 0 || is_own))
      box = box_corners(positions.subspan(v * of_mesh, of_mesh));
    // Row-major here.
    view.camera.view = glm::transpose(matrices.rows<const glm::mat4>()[v]);
    set_projection(view.camera, intrinsics.rows<const float>().subspan(v * numbers, numbers));
    settings.set_clipping(view.camera, box);
    views.push_back(view);
  }
  return views;
}

std::vector<Lights> make_lights(NamedArrays arrays, const BatchOptions& options, std::size_t views) {
  const auto is_light = [](const NamedArray& array) { return array.name.starts_with("lights."); };
  if (!options.is_lit && std::ranges::none_of(arrays, is_light)) return {};
  const auto is_by_view = [&](const NamedArray& array) {
    return is_light(array) && array.shape.size() > (array.name == "lights.ambient" ? 1U : 2U) &&
           array.shape[0] > 1;
  };
  std::vector<Lights> all(std::ranges::any_of(arrays, is_by_view) ? views : 1, options.settings.lights());
  using Shapes = std::initializer_list<std::initializer_list<std::size_t>>;
  // take(lights of a view, its numbers), of an array with a dimension of one view or of all in front, or none.
  const auto take_each = [&](std::string_view key, Shapes shapes, const std::string& form, const auto& take) {
    const NamedArray* const array = find(arrays, "lights." + std::string(key));
    if (!array) return;
    require_form(*array, Element::float32, shapes,
                 "[" + form + "], or [" + std::to_string(views) + ", " + form + "] of each view by itself");
    const std::span<const float> numbers = array->rows<const float>();
    const std::size_t count = is_by_view(*array) ? numbers.size() / views : numbers.size();
    for (std::size_t v = 0; v < all.size(); ++v)
      take(all[v], numbers.subspan(is_by_view(*array) ? v * count : 0, count));
  };
  take_each("ambient", {{3}, {1, 3}, {views, 3}}, "3", [](Lights& lights, std::span<const float> numbers) {
    lights.ambient = {numbers[0], numbers[1], numbers[2]};
  });
  take_each("harmonics", {{k_harmonics, 3}, {1, k_harmonics, 3}, {views, k_harmonics, 3}}, "9, 3",
            [](Lights& lights, std::span<const float> numbers) {
              for (std::size_t i = 0; i < numbers.size(); i += 3)
                lights.harmonics.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2]);
            });
  for_each_light_kind([&](auto kind) {
    const std::size_t count = count_numbers(kind);
    const auto take = [&](Lights& lights, std::span<const float> numbers) {
      auto& list = lights.*kind.lights;
      list.resize(numbers.size() / count);
      const float* next = numbers.data();
      for (auto& light : list) {
        kind.for_each_member([&](std::string_view key, auto member, auto...) {
          visit_numbers(key, light.*member, [&](std::string_view, float& number) { number = *next++; });
        });
      }
    };
    take_each(kind.key, {{k_any, count}, {1, k_any, count}, {views, k_any, count}},
              "L, " + std::to_string(count), take);
  });
  return all;
}

Topology make_topology(NamedArrays arrays, const RenderSettings& settings) {
  const BatchSizes sizes = check_sizes(arrays);
  Surface surface = make_surface(arrays, settings, sizes.vertices);
  if (surface.texcoords > 0 && surface.textures.empty())
    throw InvalidArgument("textures (batch)", "none beside texcoords", "both or neither");
  return {require(arrays, "faces"), sizes.views_of_faces,
          sizes.vertices,           find(arrays, "face_colors") != nullptr,
          settings.width(),         settings.height(),
          std::move(surface)};
}

RenderSettings with_numbers(RenderSettings settings, NamedArrays arrays) {
  for (const std::string_view name : k_numbers) {
    const NamedArray* const array = find(arrays, name);
    if (!array) continue;
    require_form(*array, Element::float32, {{}, {1}}, "[] or [1], a number");
    settings.set(std::string(name), static_cast<double>(array->rows<const float>()[0]));
  }
  settings.require_parts();
  return settings;
}

}  // namespace dpr::batch
