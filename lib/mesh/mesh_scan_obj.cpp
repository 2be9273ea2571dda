// The scan of OBJ.
//
// What OpenMesh 9 does with such a file:
// - a vertex line that is no three numbers ("nan" is none) is left out, and later indices shift;
// - colours are counted by the lines that have them, so one line without shifts the colours of the rest;
// - corners that repeat within a face are removed; with fewer than three left the face is dropped;
// - an index of 0 or beyond the vertices passes; a word that is no number is left out of its face;
// - a face continued on the next line by a backslash is cut;
// - a texture coordinate of one number fails the whole file;
// - the materials of the file read before are still known to a file that has none; they come in eight bits.
#include <algorithm>
#include <limits>
#include <system_error>

#include "dpr/error.hpp"
#include "mesh/mesh_scan.hpp"
#include "mesh/scan_text.hpp"

namespace dpr {
namespace {

class ObjScanner {
 public:
  ObjScanner(const std::filesystem::path& file, const std::string& text) : file_(file), lines_(text) {}

  void run() {
    while (lines_.next()) {
      scan::split(lines_.line(), words_);
      if (words_.empty() || words_[0].front() == '#') continue;
      if (words_.back().back() == '\\')
        fail("a line continued by a backslash: expected the whole on one line");
      if (words_[0] == "v") vertex();
      if (words_[0] == "vt") texture_coordinate();
      if (words_[0] == "f") face();
      if (words_[0] == "mtllib") material_library();
      if (words_[0] == "usemtl" && !library_read_) material_unknown_ = true;
    }
    for (const auto& [index, line] : forward_references_) {
      if (index >= vertices_) fail_index(static_cast<std::int64_t>(index) + 1, line);
    }
    finish_texcoords();
    scan.vertices = vertices_;
    scan.asks_material_colors = library_read_ && !material_unknown_;
    if (!has_vertex_colors_) scan.vertex_colors.clear();
  }

  MeshScan scan;

 private:
  [[noreturn]] void fail(const std::string& reason) const { throw IoError(file_, reason, lines_.number()); }

  [[noreturn]] void fail_index(std::int64_t index, std::size_t line) const {
    throw IoError(file_,
                  "a face with the vertex " + std::to_string(index) + ": expected 1 to " +
                      std::to_string(vertices_) +
                      ", or a negative number that counts back from the vertices so far",
                  line);
  }

  float number(std::size_t word) const {
    if (word >= words_.size()) fail("too few numbers after \"" + std::string(words_[0]) + "\"");
    const std::optional<float> value = scan::parse_coordinate(words_[word]);
    if (!value) fail("got " + scan::quoted(words_[word]) + ", expected a finite number");
    return *value;
  }

  void vertex() {
    for (std::size_t i = 1; i <= 3; ++i) number(i);
    glm::vec3 color(1);
    if (words_.size() >= 7) {
      color = {number(4), number(5), number(6)};
      has_vertex_colors_ = true;
    }
    scan.vertex_colors.push_back(color);
    ++vertices_;
  }

  void texture_coordinate() { scan.texcoords.emplace_back(number(1), number(2)); }

  void face() {
    corners_.clear();
    Polygon& texcoords = scan.polygon_texcoords.emplace_back();
    for (std::size_t i = 1; i < words_.size(); ++i) {
      corners_.push_back(corner(words_[i]));
      if (const auto index = corner_texcoord(words_[i])) texcoords.push_back(*index);
    }
    if (texcoords.size() < corners_.size()) lacks_texcoords_ = true;
    if (corners_.size() < 3) {
      fail("a face with " + std::to_string(corners_.size()) + " corners: expected at least three");
    }
    // Faces have few corners: comparing each with each is the quickest way to see two equal ones.
    for (auto c = corners_.begin(); c != corners_.end(); ++c) {
      if (std::find(std::next(c), corners_.end(), *c) == corners_.end()) continue;
      scan.repeated_corners[scan.polygons] = corners_;
      break;
    }
    ++scan.polygons;
  }

  std::uint32_t corner(std::string_view word) {
    const std::string_view vertex = word.substr(0, word.find('/'));
    const std::optional<std::int64_t> value = scan::parse<std::int64_t>(vertex);
    if (!value)
      fail("got the corner " + scan::quoted(word) + ", expected vertex, vertex/texture or the like");
    const std::int64_t index = *value < 0 ? *value + static_cast<std::int64_t>(vertices_) : *value - 1;
    if (index < 0 || index > std::numeric_limits<std::int32_t>::max()) fail_index(*value, lines_.number());
    // Vertices may follow the faces that use them.
    const auto corner = static_cast<std::uint32_t>(index);
    if (corner >= vertices_) forward_references_.emplace_back(corner, lines_.number());
    return corner;
  }

  /// The second number of vertex/texture/normal, if there is one.
  std::optional<std::uint32_t> corner_texcoord(std::string_view word) const {
    const std::size_t slash = word.find('/');
    if (slash == std::string_view::npos) return {};
    const std::string_view text = word.substr(slash + 1, word.find('/', slash + 1) - slash - 1);
    if (text.empty()) return {};
    const std::optional<std::int64_t> value = scan::parse<std::int64_t>(text);
    if (!value) fail("got the corner " + scan::quoted(word) + ", expected vertex/texture or the like");
    const auto known = static_cast<std::int64_t>(scan.texcoords.size());
    const std::int64_t index = *value < 0 ? *value + known : *value - 1;
    if (index < 0 || index > std::numeric_limits<std::int32_t>::max()) fail_texcoord(*value, lines_.number());
    return static_cast<std::uint32_t>(index);
  }

  [[noreturn]] void fail_texcoord(std::int64_t index, std::optional<std::size_t> line) const {
    throw IoError(file_,
                  "a face with the texture coordinate " + std::to_string(index) + ": expected 1 to " +
                      std::to_string(scan.texcoords.size()) + ", or a negative number that counts back",
                  line);
  }

  /// Texture coordinates may follow the faces that use them; without those of every corner there are none.
  void finish_texcoords() {
    if (lacks_texcoords_) scan.polygon_texcoords.clear();
    for (const Polygon& polygon : scan.polygon_texcoords) {
      for (const std::uint32_t index : polygon) {
        if (index >= scan.texcoords.size()) fail_texcoord(std::int64_t{index} + 1, {});
      }
    }
    if (scan.polygon_texcoords.empty()) scan.texcoords.clear();
  }

  void material_library() {
    const std::string_view line = lines_.line();
    const std::size_t begin = line.find("mtllib") + std::string_view("mtllib").size();
    std::string name(line.substr(begin));
    while (!name.empty() && scan::is_space(name.back())) name.pop_back();
    name.erase(0, name.find_first_not_of(" \t"));
    std::error_code error;
    if (!name.empty() && std::filesystem::is_regular_file(file_.parent_path() / name, error))
      library_read_ = true;
  }

  const std::filesystem::path& file_;
  scan::Lines lines_;
  std::vector<std::string_view> words_;
  Polygon corners_;
  std::size_t vertices_ = 0;
  std::vector<std::pair<std::uint32_t, std::size_t>> forward_references_;  // index, line
  bool has_vertex_colors_ = false, lacks_texcoords_ = false, library_read_ = false, material_unknown_ = false;
};

}  // namespace

MeshScan scan_obj(const std::filesystem::path& file, std::string text) {
  ObjScanner scanner(file, text);
  scanner.run();
  scanner.scan.text = std::move(text);
  return std::move(scanner.scan);
}

}  // namespace dpr
