// The reader of OBJ: vertices with their colours, texture coordinates, normals, polygons, and materials.
//
// The format: Wavefront's "Object Files", version 3.0. Statements that say nothing of polygons are passed
// over, with a note where they describe a shape.
#include <algorithm>
#include <array>
#include <limits>
#include <set>
#include <system_error>

#include "base/input_file.hpp"
#include "dpr/error.hpp"
#include "mesh/mesh_reader.hpp"
#include "mesh/scan_text.hpp"

namespace dpr {
namespace {

using Indices = std::vector<std::uint32_t>;

/// The material as the renderer has it. What the file leaves open is the lights'; Ns may be 0 where there is
/// no highlight to see.
Material rendered_material(const ObjReflection& reflection) {
  Material material;
  if (reflection.specular) material.specular = *reflection.specular;
  if (!reflection.has_highlights) material.specular = glm::vec3(0);
  if (reflection.shininess) material.shininess = std::max(*reflection.shininess, 1.0F);
  return material;
}

/// The texture coordinate of a corner that has none.
constexpr std::uint32_t k_no_texcoord = std::numeric_limits<std::uint32_t>::max();

/// Statements of shapes that are not read: lines, points, curves, surfaces, and what other files hold.
constexpr std::array<std::string_view, 11> k_other_shapes{"bsp",   "bzp", "call", "cdc", "cdp", "curv",
                                                          "curv2", "l",   "p",    "res", "surf"};

class ObjReader {
 public:
  ObjReader(const std::filesystem::path& file, std::string_view text, Notes& notes)
      : file_(file), lines_(scan::without_byte_order_mark(text)), notes_(notes) {}

  void run() {
    while (lines_.next()) {
      scan::split(lines_.line(), words_);
      if (words_.empty() || words_[0].front() == '#') continue;
      statement();
    }
    require_known(farthest_vertex_, mesh.positions.size(), "vertex");
    finish_colors();
    finish_texcoords();
    finish_normals();
    finish_materials();
    for (const auto& [keyword, count] : other_shapes_) {
      notes_.push_back(file_.string() + ": the statement \"" + std::string(keyword) + "\" is not read (" +
                       std::to_string(count) + (count == 1 ? " line)" : " lines)"));
    }
  }

  Mesh mesh;

 private:
  /// An index that a face uses and the line it does so on; of the largest one.
  struct Reference {
    std::int64_t index = -1;
    std::size_t line = 0;
  };

  [[noreturn]] void fail(const std::string& reason) const { throw IoError(file_, reason, lines_.number()); }

  void statement() {
    const std::string_view keyword = words_[0];
    const auto is_text = [](unsigned char c) { return c > 0x20 && c < 0x7f; };
    if (!std::ranges::all_of(keyword, is_text)) fail("the line begins with bytes that are no text");
    const bool is_read = keyword == "v" || keyword == "vt" || keyword == "vn" || keyword == "f";
    // A comment may follow numbers, but names may have a # in them.
    if (is_read) scan::split(lines_.line().substr(0, lines_.line().find('#')), words_);
    if (words_.back().back() == '\\') fail("a line continued by a backslash: expected the whole on one line");
    if (keyword == "v") vertex();
    if (keyword == "vt") texture_coordinate();
    if (keyword == "vn") mesh.normals.emplace_back(number(1), number(2), number(3));
    if (keyword == "f") face();
    if (keyword == "mtllib") material_libraries();
    if (keyword == "usemtl") use_material();
    if (const auto shape = std::ranges::find(k_other_shapes, keyword); shape != k_other_shapes.end())
      ++other_shapes_[*shape];
  }

  float number(std::size_t word) const {
    if (word >= words_.size()) fail("too few numbers after \"" + std::string(words_[0]) + "\"");
    const std::optional<float> value = scan::parse_coordinate(words_[word]);
    if (!value) fail("got " + scan::quoted(words_[word]) + ", expected a finite number");
    return *value;
  }

  /// x y z, perhaps w, or x y z r g b.
  void vertex() {
    mesh.positions.emplace_back(number(1), number(2), number(3));
    for (std::size_t i = 4; i < words_.size(); ++i) number(i);
    if (words_.size() < 7) return;
    const std::size_t vertices = mesh.positions.size();
    append_color({number(4), number(5), number(6)}, vertices - 1, vertices, mesh.vertex_colors);
  }

  void texture_coordinate() { mesh.texcoords.emplace_back(number(1), number(2)); }

  void face() {
    corners_.clear();
    texcoords_.clear();
    normals_.clear();
    for (std::size_t i = 1; i < words_.size(); ++i) corner(words_[i]);
    if (corners_.size() < 3) {
      fail("a face with " + std::to_string(corners_.size()) + " corners: expected at least three");
    }
    const std::size_t first = mesh.faces.size();
    append_fan(corners_, mesh.faces);
    const bool has_texcoords = texcoords_.size() == corners_.size();
    if (!has_texcoords) {
      texcoords_.assign(corners_.size(), k_no_texcoord);
      faces_without_texcoords_ += mesh.faces.size() - first;
    }
    append_fan(texcoords_, mesh.face_texcoords);
    if (normals_.size() == corners_.size()) append_fan(normals_, mesh.face_normals);
    if (!material_) material_ = material_number(Material());
    mesh.face_materials.resize(mesh.faces.size(), *material_);
    if (texture_ != k_no_texture && !has_texcoords) ++textured_without_texcoords_;
    mesh.face_textures.resize(mesh.faces.size(), has_texcoords ? texture_ : k_no_texture);
    if (color_) append_color(*color_, first, mesh.faces.size(), mesh.face_colors);
  }

  /// vertex, vertex/texture, vertex//normal or vertex/texture/normal.
  void corner(std::string_view word) {
    const std::size_t slash = std::min(word.find('/'), word.size());
    const std::size_t second = std::min(word.find('/', slash + 1), word.size());
    const std::string_view texture = slash < word.size() ? word.substr(slash + 1, second - slash - 1) : "";
    const std::string_view normal = second < word.size() ? word.substr(second + 1) : "";
    corners_.push_back(index(word, word.substr(0, slash), mesh.positions.size(), "vertex", farthest_vertex_));
    if (!texture.empty()) {
      texcoords_.push_back(
          index(word, texture, mesh.texcoords.size(), "texture coordinate", farthest_texcoord_));
    }
    if (!normal.empty())
      normals_.push_back(index(word, normal, mesh.normals.size(), "normal", farthest_normal_));
  }

  /// An index from zero: the file counts from one, or back from the last of those `known`. It may be one that
  /// follows.
  std::uint32_t index(std::string_view word, std::string_view text, std::size_t known,
                      const std::string& what, Reference& farthest) {
    const std::optional<std::int64_t> value = scan::parse<std::int64_t>(text);
    if (!value) fail_corner(word);
    const std::int64_t index = *value < 0 ? *value + static_cast<std::int64_t>(known) : *value - 1;
    if (index < 0 || index > std::numeric_limits<std::int32_t>::max())
      fail_index(*value, known, what, lines_.number());
    if (index > farthest.index) farthest = {index, lines_.number()};
    return static_cast<std::uint32_t>(index);
  }

  [[noreturn]] void fail_corner(std::string_view word) const {
    fail("got the corner " + scan::quoted(word) + ", expected vertex, vertex/texture or the like");
  }

  [[noreturn]] void fail_index(std::int64_t index, std::size_t known, const std::string& what,
                               std::size_t line) const {
    throw IoError(file_,
                  "a face with the " + what + " " + std::to_string(index) + ": expected 1 to " +
                      std::to_string(known) + ", or a negative number that counts back from those so far",
                  line);
  }

  void require_known(const Reference& farthest, std::size_t known, const std::string& what) const {
    if (farthest.index < static_cast<std::int64_t>(known)) return;
    fail_index(farthest.index + 1, known, what, farthest.line);
  }

  /// Colours of vertices take the place of those of materials; what has none beside others that have one is
  /// white.
  void finish_colors() {
    if (!mesh.vertex_colors.empty()) {
      mesh.vertex_colors.resize(mesh.positions.size(), glm::vec3(1));
      mesh.face_colors.clear();
    }
    if (!mesh.face_colors.empty()) mesh.face_colors.resize(mesh.faces.size(), glm::vec3(1));
  }

  /// Without textures there are coordinates of every corner or none. With some, faces that have none show no
  /// texture, wherever they look.
  void finish_texcoords() {
    require_known(farthest_texcoord_, mesh.texcoords.size(), "texture coordinate");
    if (textured_without_texcoords_ > 0) {
      notes_.push_back(file_.string() + ": polygons with a texture but without coordinates in it, " +
                       std::to_string(textured_without_texcoords_) + ": they have the colour Kd alone");
    }
    const bool is_textured =
        std::ranges::any_of(mesh.face_textures, [](std::uint32_t t) { return t != k_no_texture; });
    if (!is_textured) {
      mesh.textures.clear();
      mesh.face_textures.clear();
      if (faces_without_texcoords_ > 0) mesh.face_texcoords.clear();
      if (mesh.face_texcoords.empty()) mesh.texcoords.clear();
      return;
    }
    if (faces_without_texcoords_ > 0) add_missing_texcoords();
    for (std::uint32_t t = 0; t < maps_.size(); ++t) transform_texcoords(t);
    if (std::ranges::all_of(mesh.face_textures, [](std::uint32_t t) { return t == 0; }))
      mesh.face_textures.clear();
  }

  /// Normals of every corner or none.
  void finish_normals() {
    require_known(farthest_normal_, mesh.normals.size(), "normal");
    if (mesh.face_normals.size() != mesh.faces.size()) {
      if (!mesh.face_normals.empty()) {
        notes_.push_back(file_.string() + ": faces without normals beside others that have some, " +
                         std::to_string(mesh.faces.size() - mesh.face_normals.size()) +
                         ": all normals are computed");
      }
      mesh.face_normals.clear();
    }
    if (mesh.face_normals.empty()) mesh.normals.clear();
  }

  /// Those that change nothing are left out.
  void finish_materials() {
    if (mesh.materials.size() == 1) {
      mesh.face_materials.clear();
      if (mesh.materials[0] == Material()) mesh.materials.clear();
    }
  }

  std::uint32_t material_number(const Material& material) {
    const auto known = std::ranges::find(mesh.materials, material);
    const auto number = static_cast<std::uint32_t>(known - mesh.materials.begin());
    if (known == mesh.materials.end()) mesh.materials.push_back(material);
    return number;
  }

  void add_missing_texcoords() {
    const auto last = static_cast<std::uint32_t>(mesh.texcoords.size());
    mesh.texcoords.emplace_back(0, 0);
    for (glm::uvec3& face : mesh.face_texcoords) {
      if (face.x == k_no_texcoord) face = glm::uvec3(last);
    }
  }

  /// Coordinates that a texture scales or shifts are of its own.
  void transform_texcoords(std::uint32_t texture) {
    const ObjMaterial& map = maps_[texture];
    if (map.scale == glm::vec2(1) && map.offset == glm::vec2(0)) return;
    std::map<std::uint32_t, std::uint32_t> transformed;
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      if (mesh.face_textures[f] != texture) continue;
      for (int corner = 0; corner < 3; ++corner) {
        std::uint32_t& index = mesh.face_texcoords[f][corner];
        const auto [place, is_new] =
            transformed.emplace(index, static_cast<std::uint32_t>(mesh.texcoords.size()));
        if (is_new) mesh.texcoords.push_back(mesh.texcoords[index] * map.scale + map.offset);
        index = place->second;
      }
    }
  }

  /// Names may have spaces inside, and a line may have several names.
  void material_libraries() {
    const std::string_view rest = scan::behind(lines_.line(), words_[0]);
    if (material_library(rest)) return;
    for (std::size_t i = 1; i < words_.size(); ++i) {
      if (words_.size() > 2 && material_library(words_[i])) continue;
      lacks_library_ = true;
      notes_.push_back(file_.string() + ": the material library " + scan::quoted(words_[i]) +
                       what_is_wrong(file_.parent_path() / words_[i]) + ": faces have no colours of it");
    }
  }

  bool material_library(std::string_view name) {
    const std::filesystem::path library = file_.parent_path() / name;
    std::error_code error;
    if (!std::filesystem::is_regular_file(library, error)) return false;
    if (libraries_.insert(library).second) read_mtl(library, read_file(library), materials_);
    return true;
  }

  void use_material() {
    const std::string_view name = scan::behind(lines_.line(), words_[0]);
    const auto found = materials_.find(name);
    const ObjReflection reflection = found == materials_.end() ? ObjReflection() : found->second.reflection;
    color_ = reflection.diffuse;
    material_ = material_number(rendered_material(reflection));
    texture_ = found == materials_.end() ? k_no_texture : texture_of(name, found->second);
    if (!used_.insert(std::string(name)).second) return;
    if (found == materials_.end() && !lacks_library_) {
      notes_.push_back(file_.string() + ": the material " + scan::quoted(name) +
                       " is in no material library: its faces have no colour of it");
    }
    if (found != materials_.end()) note_unread(name, found->second);
  }

  void note_unread(std::string_view name, const ObjMaterial& material) {
    const std::string which = "the material " + scan::quoted(name);
    if (!material.ignored_options.empty()) {
      notes_.push_back(file_.string() + ": of the texture of " + which +
                       " (map_Kd) these options are not read: " + material.ignored_options);
    }
    if (!material.reflection.unread.empty())
      notes_.push_back(file_.string() + ": " + which + ": not read: " + material.reflection.unread);
    if (material.reflection.opacity < 1)
      notes_.push_back(file_.string() + ": " + which + " is transparent (d or Tr): it is rendered opaque");
  }

  /// The number of a material's texture, which is read where it is met first.
  std::uint32_t texture_of(std::string_view name, const ObjMaterial& material) {
    if (material.texture.empty()) return k_no_texture;
    const auto same = [&](const ObjMaterial& other) { return other.has_same_texture(material); };
    const auto known = std::ranges::find_if(maps_, same);
    if (known != maps_.end()) return static_cast<std::uint32_t>(known - maps_.begin());
    std::error_code error;
    if (!std::filesystem::is_regular_file(material.texture_file, error)) {
      if (!missing_textures_.insert(material.texture_file).second) return k_no_texture;
      notes_.push_back(file_.string() + ": the texture " + scan::quoted(material.texture) +
                       " of the material " + scan::quoted(name) + " (map_Kd)" +
                       what_is_wrong(material.texture_file) + ": its faces have the colour Kd alone");
      return k_no_texture;
    }
    maps_.push_back(material);
    mesh.textures.push_back(read_texture(material.texture_file));
    mesh.textures.back().opacities.clear();
    mesh.textures.back().wrap = material.wrap;
    return static_cast<std::uint32_t>(maps_.size() - 1);
  }

  const std::filesystem::path& file_;
  scan::Lines lines_;
  std::vector<std::string_view> words_;
  Indices corners_, texcoords_, normals_;  // of a face
  Reference farthest_vertex_, farthest_texcoord_, farthest_normal_;
  std::set<std::filesystem::path> libraries_;
  ObjMaterials materials_;
  std::set<std::string> used_;             // names of materials
  std::optional<glm::vec3> color_;         // of the material in use
  std::uint32_t texture_ = k_no_texture;   // the same
  std::optional<std::uint32_t> material_;  // the same, in the mesh
  std::vector<ObjMaterial> maps_;          // [texture] that uses it
  std::set<std::filesystem::path> missing_textures_;
  std::size_t faces_without_texcoords_ = 0;               // triangles
  std::size_t textured_without_texcoords_ = 0;            // polygons
  std::map<std::string_view, std::size_t> other_shapes_;  // lines by keyword
  bool lacks_library_ = false;
  Notes& notes_;
};

}  // namespace

Mesh read_obj(const std::filesystem::path& file, std::string_view text, Notes& notes) {
  ObjReader reader(file, text, notes);
  reader.run();
  return std::move(reader.mesh);
}

}  // namespace dpr
