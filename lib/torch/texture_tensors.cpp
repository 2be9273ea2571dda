#include "torch/texture_tensors.hpp"

#include <ATen/Functions.h>

#include <algorithm>
#include <array>
#include <utility>

#include "base/checks.hpp"
#include "base/name_list.hpp"
#include "image/texture_words.hpp"
#include "torch/errors.hpp"
#include "torch/index_tensors.hpp"
#include "torch/tensor_rows.hpp"

namespace dpr::torch_op {
namespace {

constexpr std::int64_t k_dimensions_of_texture = 3;

bool is_given(const at::Tensor& tensor) { return tensor.defined() && tensor.numel() > 0; }

std::int64_t count_of(const at::Tensor& tensor) { return is_given(tensor) ? tensor.size(0) : 0; }

int texture_side(std::int64_t texels) {
  if (texels >= 1 && texels <= checks::k_largest_side) return static_cast<int>(texels);
  throw InvalidArgument("textures (dpr::render)", std::to_string(texels),
                        "1 to " + std::to_string(checks::k_largest_side) + " texels a side");
}

/// What the word of a texture says, of a list of one for each texture, one for all, or none.
template <typename Value, std::size_t count>
Value mode_of(const std::vector<std::string>& words, std::size_t texture, std::size_t textures,
              const std::array<std::string_view, count>& names, const char* argument, Value otherwise) {
  if (words.empty()) return otherwise;
  if (words.size() != 1 && words.size() != textures) {
    throw InvalidArgument(std::string(argument) + " (dpr::render)", std::to_string(words.size()) + " words",
                          "one, or one for each texture: " + std::to_string(textures));
  }
  const std::string& word = words[words.size() == 1 ? 0 : texture];
  return static_cast<Value>(position_of(word, names, std::string(argument) + " (dpr::render)"));
}

std::vector<TextureForm> texture_forms(const SurfaceLayout& layout, std::int64_t texels) {
  const std::vector<std::int64_t>& sizes = layout.texture_sizes;
  if (sizes.size() % 2 != 0) {
    throw InvalidArgument("texture_sizes (dpr::_render)", std::to_string(sizes.size()) + " numbers",
                          "height and width of each texture");
  }
  const std::size_t count = sizes.size() / 2;
  const TextureForm usual;
  std::vector<TextureForm> forms;
  std::int64_t expected = 0;
  for (std::size_t i = 0; i < count; ++i) {
    forms.push_back({texture_side(sizes[2 * i + 1]), texture_side(sizes[2 * i]),
                     mode_of(layout.wraps, i, count, k_wrap_names, "wrap", usual.wrap),
                     mode_of(layout.filters, i, count, k_filter_names, "filter", usual.filter)});
    expected += sizes[2 * i] * sizes[2 * i + 1];
  }
  if (texels != expected) {
    throw InvalidArgument("textures (dpr::render)", std::to_string(texels) + " texels",
                          std::to_string(expected) + ", by height and width of each");
  }
  return forms;
}

void require_materials(const SurfaceNumbers& numbers) {
  const std::int64_t colors = count_of(numbers.specular), exponents = count_of(numbers.shininess);
  if (exponents == 0 || exponents == colors) return;
  throw InvalidArgument("materials.shininess (dpr::render)", std::to_string(exponents) + " numbers",
                        std::to_string(colors) + ", one for each specular");
}

/// Checked as `shape` where there is one.
at::Tensor checked_number(const at::Tensor& tensor, const char* name,
                          std::initializer_list<std::int64_t> shape, const char* expected) {
  return is_given(tensor) ? checked(tensor, name, shape, expected) : tensor;
}

template <typename Vector>
at::Tensor copy_of(const std::vector<Vector>& vectors) {
  at::Tensor tensor = at::empty({static_cast<std::int64_t>(vectors.size()), Vector::length()}, at::kFloat);
  std::ranges::copy(vectors, reinterpret_cast<Vector*>(tensor.data_ptr<float>()));
  return tensor;
}

/// The tensors by their names.
void take_named(const NamedTensors& given, PackedSurface& packed) {
  SurfaceLayout& layout = packed.layout;
  SurfaceNumbers& numbers = packed.numbers;
  const std::array<std::pair<std::string_view, at::Tensor*>, 6> places{
      {{"texcoords", &numbers.texcoords},
       {"face_texcoords", &layout.face_texcoords},
       {"face_textures", &layout.face_textures},
       {"specular", &numbers.specular},
       {"shininess", &numbers.shininess},
       {"face_materials", &layout.face_materials}}};
  std::array<std::string_view, places.size()> names;
  std::ranges::transform(places, names.begin(), [](const auto& place) { return place.first; });
  for (const auto& entry : given)
    *places.at(position_of(entry.key(), names, "surface (dpr::render_textured)")).second = entry.value();
}

}  // namespace

SurfaceNumbers checked(const SurfaceNumbers& numbers) {
  return {checked_number(numbers.texcoords, "texcoords", {-1, 2}, "[texcoord, 2]"),
          checked_number(numbers.texels, "textures", {-1, 3}, "[texel, 3]"),
          checked_number(numbers.specular, "materials.specular", {-1, 3}, "[material, 3]"),
          checked_number(numbers.shininess, "materials.shininess", {-1}, "[material]")};
}

Surface make_surface(const SurfaceLayout& layout, const SurfaceNumbers& numbers, const Faces& faces,
                     std::int64_t vertices) {
  Surface surface;
  surface.textures = texture_forms(layout, count_of(numbers.texels));
  if (surface.textures.empty() != !is_given(numbers.texcoords)) {
    const bool has_textures = !surface.textures.empty();
    throw InvalidArgument(has_textures ? "texcoords (dpr::render)" : "textures (dpr::render)",
                          has_textures ? "none beside textures" : "none beside texcoords", "both or neither");
  }
  require_materials(numbers);
  surface.texcoords = static_cast<std::size_t>(count_of(numbers.texcoords));
  surface.materials = static_cast<std::size_t>(count_of(numbers.specular));
  if (is_given(layout.face_texcoords)) {
    surface.face_texcoords = read_faces(layout.face_texcoords, "face_texcoords (dpr::render)");
  } else if (surface.texcoords > 0) {
    if (count_of(numbers.texcoords) != vertices) {
      throw InvalidArgument("texcoords (dpr::render)", shape_text(numbers.texcoords),
                            "[" + std::to_string(vertices) + ", 2], one a vertex, or face_texcoords beside");
    }
    surface.face_texcoords = faces;
  }
  if (is_given(layout.face_textures))
    surface.face_textures = read_of_faces(layout.face_textures, "face_textures (dpr::render)", -1);
  if (is_given(layout.face_materials))
    surface.face_materials = read_of_faces(layout.face_materials, "face_materials (dpr::render)", 0);
  return surface;
}

void upload_surface(Renderer& renderer, const SurfaceNumbers& numbers) {
  const Mesh& mesh = renderer.scene().meshes[0].mesh;
  if (!mesh.texcoords.empty()) renderer.set_texcoords(0, rows<glm::vec2>(numbers.texcoords));
  for (std::size_t i = 0, first = 0; i < mesh.textures.size(); ++i) {
    const std::size_t count = mesh.textures[i].texels.size();
    renderer.set_texels(0, i, rows<glm::vec3>(numbers.texels).subspan(first, count));
    first += count;
  }
  if (mesh.materials.empty()) return;
  std::vector<Material> materials;
  for (const glm::vec3& specular : rows<glm::vec3>(numbers.specular)) materials.push_back({specular, {}});
  for (std::size_t i = 0; is_given(numbers.shininess) && i < materials.size(); ++i)
    materials[i].shininess = numbers.shininess.data_ptr<float>()[i];
  renderer.set_materials(0, materials);
}

SurfaceNumbers surface_gradients(const Mesh& mesh, const MeshGradient& gradient,
                                 const WantedOfSurface& wanted) {
  const auto materials = static_cast<std::int64_t>(mesh.materials.size());
  SurfaceNumbers grad;
  if (wanted.texcoords) grad.texcoords = copy_of(gradient.texcoords);
  if (wanted.texels) {
    std::vector<at::Tensor> textures;
    for (const std::vector<glm::vec3>& texels : gradient.textures) textures.push_back(copy_of(texels));
    grad.texels = at::cat(textures);
  }
  if (wanted.specular) {
    grad.specular =
        gradient.specular.empty() ? at::zeros({materials, 3}, at::kFloat) : copy_of(gradient.specular);
  }
  if (wanted.shininess) {
    grad.shininess = gradient.shininess.empty() ? at::zeros({materials}, at::kFloat)
                                                : at::tensor(gradient.shininess, at::kFloat);
  }
  return grad;
}

PackedSurface pack(const TextureTensors& given) {
  const at::Tensor none = at::empty({0}, at::kFloat);
  PackedSurface packed{{}, {none, none, none, none}};
  packed.layout.wraps = given.wraps;
  packed.layout.filters = given.filters;
  take_named(given.surface, packed);
  at::Tensor& specular = packed.numbers.specular;
  const at::Tensor& shininess = packed.numbers.shininess;
  if (!is_given(specular) && is_given(shininess)) specular = at::ones({shininess.size(0), 3}, at::kFloat);
  at::Tensor& texcoords = packed.numbers.texcoords;
  if (texcoords.dim() == 3) {  // of corners
    if (packed.layout.face_texcoords.defined()) {
      throw InvalidArgument("face_texcoords (dpr::render_textured)", "them beside texcoords of corners",
                            "one of the two");
    }
    const std::int64_t corners = texcoords.size(0) * texcoords.size(1);
    packed.layout.face_texcoords = at::arange(corners, at::kLong).view({texcoords.size(0), -1});
    texcoords = texcoords.reshape({corners, -1});
  }
  std::vector<at::Tensor> texels;
  for (const at::Tensor& texture : given.textures) {
    const at::Tensor image =
        checked(texture, "textures", {-1, -1, 3}, "[height, width, 3] or [view, height, width, 3]");
    packed.layout.texture_sizes.insert(packed.layout.texture_sizes.end(), {image.size(0), image.size(1)});
    texels.push_back(image.view({-1, 3}));
  }
  if (!texels.empty()) packed.numbers.texels = at::cat(texels);
  return packed;
}

bool is_of_views(const TextureTensors& given) {
  return std::ranges::any_of(given.textures,
                             [](const at::Tensor& t) { return t.dim() == k_dimensions_of_texture + 1; });
}

TextureTensors of_view(TextureTensors given, const ViewOfBatch& view) {
  for (at::Tensor& texture : given.textures)
    texture = of_view(texture, k_dimensions_of_texture, view, "textures");
  return given;
}

}  // namespace dpr::torch_op
