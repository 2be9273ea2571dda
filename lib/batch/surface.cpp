// The textures, materials and opacities of a mesh from named arrays, and these to a renderer.
#include <algorithm>
#include <string>
#include <utility>

#include "base/checks.hpp"
#include "batch/inputs.hpp"
#include "dpr/error.hpp"

namespace dpr::batch {
namespace {

int texture_side(std::size_t texels, const NamedArray& texture) {
  if (texels >= 1 && texels <= checks::k_largest_side) return static_cast<int>(texels);
  throw InvalidArgument(argument(texture), std::to_string(texels),
                        "1 to " + std::to_string(checks::k_largest_side) + " texels a side");
}

/// A texture's mode, of a list of one for each texture, one for all, or none.
template <typename Mode>
Mode mode_of(const std::vector<Mode>& modes, std::size_t texture, std::size_t textures, const char* name,
             Mode otherwise) {
  if (modes.empty()) return otherwise;
  if (modes.size() != 1 && modes.size() != textures) {
    throw InvalidArgument(std::string(name) + " (batch)", std::to_string(modes.size()) + " words",
                          "one, or one for each texture: " + std::to_string(textures));
  }
  return modes[modes.size() == 1 ? 0 : texture];
}

std::vector<TextureForm> texture_forms(NamedArrays arrays, const RenderSettings& settings) {
  const std::size_t count = count_textures(arrays);
  const TextureForm usual;
  std::vector<TextureForm> forms;
  for (std::size_t i = 0; i < count; ++i) {
    const NamedArray& texture = require(arrays, texture_name(i));
    require_form(texture, Element::float32,
                 {{k_any, k_any, 3}, {1, k_any, k_any, 3}, {k_any, k_any, 4}, {1, k_any, k_any, 4}},
                 "[H, W, 3] or [H, W, 4], or with N in front of each view by itself");
    const std::size_t rows = texture.shape.size() - 3;
    forms.push_back({texture_side(texture.shape[rows + 1], texture),
                     texture_side(texture.shape[rows], texture),
                     mode_of(settings.wraps(), i, count, "wrap", usual.wrap),
                     mode_of(settings.filters(), i, count, "filter", usual.filter), has_alpha(texture)});
  }
  return forms;
}

/// The number of opacities of that name, `count` for each view with faces of its own; 0 without.
std::size_t count_opacities(NamedArrays arrays, std::string_view name, std::size_t views, std::size_t count) {
  const NamedArray* const opacities = find(arrays, name);
  if (!opacities) return 0;
  const std::string of_view = std::to_string(count) + "]";
  if (views > 1) {
    require_floats(*opacities, {views, count}, "[" + std::to_string(views) + ", " + of_view);
  } else {
    require_floats(*opacities, {count}, "[" + of_view);
  }
  return views * count;
}

/// Texture coordinates and what refers to them: of vertices, of corners, or by indices.
void take_texcoords(NamedArrays arrays, const NamedArray& faces, std::size_t vertices, Surface& surface) {
  const auto [views, count] = sizes_of(faces);
  const NamedArray* const texcoords = find(arrays, "texcoords");
  const NamedArray* const indices = find(arrays, "face_texcoords");
  if (!texcoords) {
    if (indices) throw InvalidArgument(argument(*indices), "them alone", "them beside texcoords");
    return;
  }
  surface.texcoords = texcoords->count() / 2;
  if (indices) {
    require_floats(*texcoords, {k_any, 2}, "[T, 2], beside face_texcoords");
    surface.face_texcoords = read_triples(*indices, views);
    if (surface.face_texcoords.size() == views * count) return;
    throw InvalidArgument(argument(*indices), text_of(indices->shape),
                          "as many as faces: " + std::to_string(count));
  }
  if (views > 1)
    throw InvalidArgument(argument(*texcoords), "no face_texcoords",
                          "them beside faces of every view by itself");
  const std::string of_faces = std::to_string(count);
  require_form(*texcoords, Element::float32, {{vertices, 2}, {count, 3, 2}},
               "[" + std::to_string(vertices) + ", 2] or [" + of_faces + ", 3, 2], or face_texcoords beside");
  if (texcoords->shape.size() == 2) {
    surface.face_texcoords = read_triples(faces);
    return;
  }
  for (std::uint32_t i = 0; i < 3 * count; i += 3) surface.face_texcoords.emplace_back(i, i + 1, i + 2);
}

std::size_t count_materials(NamedArrays arrays) {
  const NamedArray* const specular = find(arrays, "materials.specular");
  const NamedArray* const shininess = find(arrays, "materials.shininess");
  if (specular) require_floats(*specular, {k_any, 3}, "[M, 3]");
  if (!shininess) return specular ? specular->shape[0] : 0;
  require_floats(*shininess, {k_any}, "[M]");
  const std::size_t count = specular ? specular->shape[0] : shininess->shape[0];
  require_floats(*shininess, {count}, "[" + std::to_string(count) + "], one for each specular");
  return count;
}

std::vector<std::uint32_t> read_of_faces(NamedArrays arrays, std::string_view name, const FaceSizes& faces,
                                         std::int64_t least) {
  const NamedArray* const indices = find(arrays, name);
  return indices ? read_indices(*indices, faces.views, faces.count, least) : std::vector<std::uint32_t>();
}

}  // namespace

void take_texture(const NamedArray& from, std::vector<glm::vec3>& texels, std::vector<float>& opacities) {
  texels.clear();
  opacities.clear();
  if (!has_alpha(from)) {
    const auto rows = from.rows<const glm::vec3>();
    return texels.assign(rows.begin(), rows.end());
  }
  for (const glm::vec4& texel : from.rows<const glm::vec4>()) {
    texels.emplace_back(texel);
    opacities.push_back(texel.a);
  }
}

Surface make_surface(NamedArrays arrays, const RenderSettings& settings, std::size_t vertices) {
  const NamedArray& faces = require(arrays, "faces");
  const FaceSizes sizes = sizes_of(faces);
  require_triples(faces, sizes.views);
  Surface surface;
  surface.textures = texture_forms(arrays, settings);
  take_texcoords(arrays, faces, vertices, surface);
  if (!surface.textures.empty() && surface.texcoords == 0)
    throw InvalidArgument("texcoords (batch)", "none beside textures", "both or neither");
  surface.materials = count_materials(arrays);
  surface.vertex_opacities = count_opacities(arrays, "opacities", sizes.views, vertices);
  surface.face_opacities = count_opacities(arrays, "face_opacities", sizes.views, sizes.count);
  if (surface.vertex_opacities > 0 && surface.face_opacities > 0)
    throw InvalidArgument("opacities (batch)", "opacities and face_opacities", "one of them");
  surface.face_textures = read_of_faces(arrays, "face_textures", sizes, -1);
  surface.face_materials = read_of_faces(arrays, "face_materials", sizes, 0);
  return surface;
}

void upload_surface(Renderer& renderer, NamedArrays arrays) {
  const Mesh& mesh = renderer.scene().meshes[0].mesh;
  if (!mesh.texcoords.empty())
    renderer.set_texcoords(0, require(arrays, "texcoords").rows<const glm::vec2>());
  std::vector<glm::vec3> texels;
  std::vector<float> texel_opacities;
  for (std::size_t i = 0; i < mesh.textures.size(); ++i) {
    const NamedArray& texture = require(arrays, texture_name(i));
    if (!has_alpha(texture)) {  // millions, perhaps: not copied
      renderer.set_texels(0, i, texture.rows<const glm::vec3>());
      continue;
    }
    take_texture(texture, texels, texel_opacities);
    renderer.set_texels(0, i, texels);
    renderer.set_texel_opacities(0, i, texel_opacities);
  }
  if (const NamedArray* const opacities = find_opacities(arrays))
    renderer.set_opacities(0, opacities->rows<const float>());
  if (mesh.materials.empty()) return;
  std::vector<Material> materials(mesh.materials.size());
  const NamedArray* const specular = find(arrays, "materials.specular");
  const NamedArray* const shininess = find(arrays, "materials.shininess");
  for (std::size_t i = 0; i < materials.size(); ++i) {
    if (specular) materials[i].specular = specular->rows<const glm::vec3>()[i];
    if (shininess) materials[i].shininess = shininess->rows<const float>()[i];
  }
  renderer.set_materials(0, materials);
}

}  // namespace dpr::batch
