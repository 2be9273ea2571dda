// Every gradient once: its name, its shape and where it lives. Files, commands, sums over devices, standard
// errors, checks and tests walk this table.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <variant>
#include <vector>

#include "dpr/renderer.hpp"
#include "dpr/scene.hpp"

namespace dpr {

/// A name in a scene's list of gradients.
struct GradientName {
  std::string_view word;
  bool GradientRequest::*wanted;
};
std::span<const GradientName> gradient_names();
/// By its name. Throws InvalidArgument for another word, which it calls `argument`.
bool GradientRequest::*parse_gradient(std::string_view word, const std::string& argument);
/// Asks for none.
GradientRequest no_gradients();

/// Owner of a gradient array. A view's arrays belong to it alone; the others are sums over the views.
enum class GradientOf { scene, mesh, light, view, mesh_in_view, all_views };

/// True if the arrays of a batch's parts are concatenated, not added.
inline bool is_per_view(GradientOf of) {
  return of == GradientOf::view || of == GradientOf::mesh_in_view || of == GradientOf::all_views;
}

/// Number of the view, and of the mesh or light; 0 where there is one.
struct GradientIndex {
  std::size_t view = 0, item = 0;
};

/// A number, a vector, one vector for each vertex, colour, texture coordinate, normal, material or
/// coefficient, one number for each material or opacity, or a list of texels or of their opacities for each texture.
using GradientArray =
    std::variant<double*, glm::dvec3*, std::vector<glm::vec3>*, std::vector<glm::vec2>*, std::vector<double>*,
                 std::vector<float>*, std::vector<std::vector<glm::vec3>>*, std::vector<std::vector<float>>*>;

struct GradientRow {
  bool GradientRequest::*wanted;
  GradientOf of;
  /// In a gradient file: members, and [] after a list that has one object for each mesh or light. Views'
  /// arrays are those of the file's only view, and no file has those of `all_views`.
  std::string path;
  std::function<GradientArray(SceneGradient& gradient, GradientIndex index)> array;
  /// True if a scene has the input whose gradient this is. Null: every scene has.
  std::function<bool(const Scene& scene)> exists = nullptr;
  /// Number of lights of the kind.
  std::function<std::size_t(const SceneGradient& gradient)> lights = nullptr;
};
std::span<const GradientRow> gradient_rows();

/// True if the input of a row's array exists in the scene, or in its view if the row is a view's.
bool exists(const GradientRow& row, GradientIndex index, const Scene& scene, std::span<const View> views);

/// Number of a gradient's arrays in a row.
GradientIndex count_arrays(const GradientRow& row, const SceneGradient& gradient);

/// Adds the numbers of one array to those of another; one without numbers becomes the other's equal. Throws
/// InvalidArgument where both have some, and not as many.
void add_numbers(const GradientArray& to, const GradientArray& from);

/// "views[0].camera.rotation", as messages have it.
std::string name_of(const GradientRow& row, GradientIndex index);

/// visit(row, index, array) for every array of a gradient, in the order of the table.
template <class Visit>
void for_each_array(SceneGradient& gradient, const Visit& visit) {
  for (const GradientRow& row : gradient_rows()) {
    const GradientIndex count = count_arrays(row, gradient);
    for (GradientIndex i; i.view < count.view; ++i.view) {
      for (i.item = 0; i.item < count.item; ++i.item) visit(row, i, row.array(gradient, i));
    }
  }
}

/// Replaces every number of an array by f(number), in order.
template <class F>
void transform_numbers(const GradientArray& array, F&& f) {
  const auto replace = [&](auto& number) {
    number = static_cast<std::remove_reference_t<decltype(number)>>(f(static_cast<double>(number)));
  };
  const auto replace_all = [&](const auto& itself, auto& list) -> void {
    if constexpr (requires { list.begin(); }) {
      for (auto& element : list) itself(itself, element);
    } else if constexpr (requires { list.length(); }) {
      for (int axis = 0; axis < list.length(); ++axis) replace(list[axis]);
    } else {
      replace(list);
    }
  };
  std::visit([&](auto* list) { replace_all(replace_all, *list); }, array);
}

/// Replaces every number of a gradient.
template <class F>
void transform_numbers(SceneGradient& gradient, F&& f) {
  for_each_array(gradient, [&](const GradientRow&, GradientIndex, const GradientArray& array) {
    transform_numbers(array, f);
  });
}

/// Sums over views are added in the order of the chunks, in double precision; what is one view's comes one
/// after the other. A single chunk's is that chunk's. At least one.
SceneGradient sum_of(std::vector<SceneGradient>&& chunks);

/// Throws InvalidArgument that names the first gradient that is not finite.
void require_finite(SceneGradient& gradient);

}  // namespace dpr
