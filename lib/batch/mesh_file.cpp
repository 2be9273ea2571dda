// Files of meshes as named arrays, in the C interface.
#include <algorithm>
#include <array>
#include <list>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/checks.hpp"
#include "base/input_file.hpp"
#include "base/name_list.hpp"
#include "batch/inputs.hpp"
#include "c/handles.hpp"
#include "dpr/error.hpp"
#include "dpr/notes.hpp"
#include "image/texture_words.hpp"

namespace dpr::batch {

/// A mesh, and the arrays of the C interface that show its memory.
class MeshFile {
 public:
  explicit MeshFile(const std::string& file) : mesh_(read_mesh(file, notes_)) {
    add("vertices", mesh_.positions, 3);
    add("faces", mesh_.faces, 3);
    add("colors", mesh_.vertex_colors, 3);
    add("face_colors", mesh_.face_colors, 3);
    add("opacities", mesh_.vertex_opacities, 1);
    add("face_opacities", mesh_.face_opacities, 1);
    add("texcoords", mesh_.texcoords, 2);
    add("face_texcoords", mesh_.face_texcoords, 3);
    add("face_textures", mesh_.face_textures, 1);
    add("face_materials", mesh_.face_materials, 1);
    add_textures();
    add_materials();
    const auto point_to = [](const std::vector<std::string>& words, std::vector<const char*>& pointers) {
      std::ranges::transform(words, std::back_inserter(pointers), &std::string::c_str);
    };
    point_to(settings_, setting_words_);
    point_to(notes_, note_words_);
  }
  MeshFile(const MeshFile&) = delete;
  MeshFile& operator=(const MeshFile&) = delete;

  dpr_mesh_contents contents() const {
    dpr_mesh_contents contents = DPR_MESH_CONTENTS_INIT;
    contents.arrays = arrays_.data();
    contents.array_count = arrays_.size();
    contents.settings = setting_words_.data();
    contents.setting_count = setting_words_.size();
    contents.notes = note_words_.data();
    contents.note_count = note_words_.size();
    return contents;
  }

 private:
  void add(std::string name, void* data, Element element, std::initializer_list<std::size_t> shape) {
    dpr_array array{names_.emplace_back(std::move(name)).c_str(),
                    data,
                    static_cast<int>(element),
                    static_cast<int>(shape.size()),
                    {}};
    std::ranges::copy(shape, array.shape);
    arrays_.push_back(array);
  }

  /// Rows of numbers; none where there are no rows.
  template <class Row>
  void add(const char* name, std::vector<Row>& rows, std::size_t numbers) {
    constexpr bool k_is_whole = std::is_same_v<Row, glm::uvec3> || std::is_same_v<Row, std::uint32_t>;
    const Element element = k_is_whole ? Element::int32 : Element::float32;
    if (rows.empty()) return;
    if (numbers == 1) return add(name, rows.data(), element, {rows.size()});
    add(name, rows.data(), element, {rows.size(), numbers});
  }

  void add_textures() {
    std::string wraps = "wrap=", filters = "filter=";
    for (std::size_t i = 0; i < mesh_.textures.size(); ++i) {
      Texture& texture = mesh_.textures[i];
      const auto height = static_cast<std::size_t>(texture.height),
                 width = static_cast<std::size_t>(texture.width);
      if (texture.opacities.empty()) {
        add(texture_name(i), texture.texels.data(), Element::float32, {height, width, 3});
      } else {
        std::vector<glm::vec4>& texels = with_opacities_.emplace_back();
        for (std::size_t k = 0; k < texture.texels.size(); ++k)
          texels.emplace_back(texture.texels[k], texture.opacities[k]);
        add(texture_name(i), texels.data(), Element::float32, {height, width, 4});
      }
      const char* const comma = i == 0 ? "" : ",";
      wraps.append(comma).append(to_string(texture.wrap));
      filters.append(comma).append(to_string(texture.filter));
    }
    if (!mesh_.textures.empty()) settings_ = {wraps, filters};
  }

  /// Exponents are left out where not every material has one: the arrays cannot say that one has none.
  void add_materials() {
    const std::vector<Material>& materials = mesh_.materials;
    for (const Material& material : materials) {
      specular_.push_back(material.specular);
      if (material.shininess) shininess_.push_back(*material.shininess);
    }
    if (!shininess_.empty() && shininess_.size() != materials.size()) {
      notes_.emplace_back("the materials' exponents are left out: some materials have none");
      shininess_.clear();
    }
    add("materials.specular", specular_, 3);
    add("materials.shininess", shininess_, 1);
  }

  Notes notes_;
  Mesh mesh_;
  std::list<std::vector<glm::vec4>> with_opacities_;  // texels of such textures
  std::vector<glm::vec3> specular_;
  std::vector<float> shininess_;
  std::list<std::string> names_;
  std::vector<dpr_array> arrays_;
  std::vector<std::string> settings_;
  std::vector<const char*> setting_words_, note_words_;
};

namespace {

Mesh make_mesh(NamedArrays arrays, const RenderSettings& settings) {
  static constexpr std::array<std::string_view, 7> k_names{
      "vertices", "faces", "colors", "face_colors", "texcoords", "face_texcoords", "face_textures"};
  for (const NamedArray& array : arrays) {
    if (std::ranges::find(k_names, array.name) == k_names.end() && !array.name.starts_with("textures["))
      throw InvalidArgument("array (mesh)", "\"" + array.name + "\"",
                            one_of(k_names) + ", or textures[0], ...");
  }
  const NamedArray &vertices = require(arrays, "vertices"), &faces = require(arrays, "faces");
  require_floats(vertices, {k_any, 3}, "[V, 3]");
  Mesh mesh;
  const auto take = [](const NamedArray& array, auto& rows) {
    const auto from = array.rows<const typename std::remove_reference_t<decltype(rows)>::value_type>();
    rows.assign(from.begin(), from.end());
  };
  take(vertices, mesh.positions);
  mesh.faces = read_triples(faces);
  add_surface(mesh, make_surface(arrays, settings, mesh.positions.size()));
  const auto take_colors = [&](std::string_view name, std::size_t count, std::vector<glm::vec3>& colors) {
    const NamedArray* const given = find(arrays, name);
    if (!given) return;
    require_floats(*given, {count, 3}, "[" + std::to_string(count) + ", 3]");
    take(*given, colors);
  };
  take_colors("colors", mesh.positions.size(), mesh.vertex_colors);
  take_colors("face_colors", mesh.faces.size(), mesh.face_colors);
  if (!mesh.texcoords.empty()) take(require(arrays, "texcoords"), mesh.texcoords);
  for (std::size_t i = 0; i < mesh.textures.size(); ++i)
    take_texture(require(arrays, texture_name(i)), mesh.textures[i].texels, mesh.textures[i].opacities);
  return mesh;
}

}  // namespace
}  // namespace dpr::batch

using namespace dpr::c;

struct dpr_mesh_file {
  static constexpr const char* k_handle = "dpr_mesh_file";
  std::unique_ptr<dpr::batch::MeshFile> file;
};

dpr_status dpr_mesh_file_read(const char* path, dpr_mesh_file** file) {
  return guarded([&] {
    deref(file, "file");
    give(file, std::make_unique<dpr::batch::MeshFile>(&deref(path, "path")));
  });
}

dpr_status dpr_mesh_file_contents(const dpr_mesh_file* file, dpr_mesh_contents* contents) {
  return guarded([&] { fill(contents, deref(file, "file").file->contents(), "contents"); });
}

void dpr_mesh_file_destroy(dpr_mesh_file* file) { destroy(file); }

dpr_status dpr_mesh_file_write(const char* path, const dpr_array* arrays, std::size_t count,
                               const char* const* settings, std::size_t setting_count) {
  return guarded([&] {
    const std::string to = &deref(path, "path");
    const auto how =
        dpr::batch::settings_from_texts(1, 1, dpr::batch::to_words(settings, setting_count, "settings"));
    const dpr::Mesh mesh = dpr::batch::make_mesh(dpr::batch::to_arrays(arrays, count, "arrays"), how);
    const std::string extension = dpr::lower_case_extension(to);
    if (!mesh.textures.empty() && extension != ".glb")
      throw dpr::InvalidArgument("textures (dpr_mesh_file_write)", to,
                                 "a .glb file, which alone holds textures");
    if (!mesh.texcoords.empty() && extension == ".ply")
      throw dpr::InvalidArgument("texcoords (dpr_mesh_file_write)", to,
                                 "an .obj or .glb file, which hold texture coordinates");
    dpr::write_mesh(to, mesh);
  });
}
