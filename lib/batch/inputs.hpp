// The library's types from named arrays. All throw InvalidArgument, which names the array, for what does not
// fit.
#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "batch/batch.hpp"
#include "dpr/dpr.h"
#include "scene/gradient_table.hpp"

namespace dpr::batch {

/// The names that arrays may have, and no other; and the counts of views, of a view's vertices, and of the views that
/// have faces of their own: all, or 1 where they share them.
struct BatchSizes {
  std::size_t views, vertices, views_of_faces;
};
BatchSizes check_sizes(NamedArrays arrays);

/// Affine matrices, projections, and planes around every view's vertices.
std::vector<View> make_views(NamedArrays arrays, const RenderSettings& settings);
/// None: colours as they are. One: of all views; else of each of them.
std::vector<Lights> make_lights(NamedArrays arrays, const BatchOptions& options, std::size_t views);
/// Texture coordinates, textures and materials of a mesh of so many vertices.
Surface make_surface(NamedArrays arrays, const RenderSettings& settings, std::size_t vertices);
Topology make_topology(NamedArrays arrays, const RenderSettings& settings);
/// The settings, with the numbers that are arrays.
RenderSettings with_numbers(RenderSettings settings, NamedArrays arrays);
/// Vertices' or faces' colours; null: white.
const NamedArray* find_colors(NamedArrays arrays);
/// Those of the vertices or of the faces; none: null.
const NamedArray* find_opacities(NamedArrays arrays);
/// "textures[2]"
std::string texture_name(std::size_t index);
std::size_t count_textures(NamedArrays arrays);
/// How many views have faces of their own, or 1, and how many faces each has.
struct FaceSizes {
  std::size_t views, count;
};
FaceSizes sizes_of(const NamedArray& faces);
/// True if the fourth channel is there, which is opacity.
bool has_alpha(const NamedArray& texture);
void take_texture(const NamedArray& from, std::vector<glm::vec3>& texels, std::vector<float>& opacities);
/// Rows of the gradients' table whose numbers are an array's gradient, but for those of views' matrices: of lights
/// and views one after the other. None for other names.
std::vector<const GradientRow*> gradient_rows_of(std::string_view name);
/// To a renderer of their topology.
void upload_surface(Renderer& renderer, NamedArrays arrays);

/// From the C interface, which calls them `argument`.
std::vector<NamedArray> to_arrays(const dpr_array* arrays, std::size_t count, const char* argument);
std::vector<std::string> to_words(const char* const* words, std::size_t count, const char* argument);
dpr_frame_options to_options(const dpr_frame_options* options);
RenderSettings to_settings(const dpr_frame_options& options);

}  // namespace dpr::batch
