// The reader of OFF, in text: vertices, polygons and the colours of either.
//
// The format: Geomview's "OFF Files". A header's letters say what a vertex has behind its position, in the
// order of normal (N), colour (C) and texture coordinates (ST). Under any header a line may go on with a
// colour, as many programs write it.
#include <array>

#include "dpr/error.hpp"
#include "mesh/mesh_reader.hpp"
#include "mesh/scan_text.hpp"

namespace dpr {
namespace {

class OffReader {
 public:
  OffReader(const std::filesystem::path& file, std::string_view text)
      : file_(file), lines_(scan::without_byte_order_mark(text)) {}

  void run() {
    header();
    vertices_ = count("vertices");
    faces_ = count("faces");
    for (std::size_t i = 0; i < vertices_; ++i) vertex();
    for (std::size_t i = 0; i < faces_; ++i) face();
    if (next_line()) fail("the file goes on after the last face that its header promises");
    if (!mesh.vertex_colors.empty()) {
      mesh.vertex_colors.resize(vertices_, glm::vec3(1));
      mesh.face_colors.clear();
    }
    if (!mesh.face_colors.empty()) mesh.face_colors.resize(mesh.faces.size(), glm::vec3(1));
  }

  Mesh mesh;

 private:
  [[noreturn]] void fail(const std::string& reason) const { throw IoError(file_, reason, lines_.number()); }

  /// The words of the next line that has any.
  bool next_line() {
    while (lines_.next()) {
      scan::split(lines_.line().substr(0, lines_.line().find('#')), words_);
      next_word_ = 0;
      if (!words_.empty()) return true;
    }
    return false;
  }

  void require_line() {
    if (next_line()) return;
    fail("the file ends here: expected " + std::to_string(vertices_) + " vertices and " +
         std::to_string(faces_) + " faces");
  }

  std::string_view word() {
    if (next_word_ == words_.size()) fail("too few numbers on the line");
    return words_[next_word_++];
  }

  float number() {
    const std::string_view text = word();
    const std::optional<float> value = scan::parse_coordinate(text);
    if (!value) fail("got " + scan::quoted(text) + ", expected a finite number");
    return *value;
  }

  void header() {
    require_line();
    const std::string_view name = word();
    constexpr std::array<std::string_view, 8> k_names{"OFF",   "COFF",   "NOFF",   "CNOFF",
                                                      "STOFF", "STCOFF", "STNOFF", "STCNOFF"};
    if (std::ranges::find(k_names, name) == k_names.end()) {
      fail("got the header " + scan::quoted(name) +
           ", expected OFF, COFF, NOFF or CNOFF, perhaps with ST before it");
    }
    if (next_word_ < words_.size() && words_[next_word_] == "BINARY")
      fail("a binary OFF file: expected one of text");
    has_normals_ = name.find('N') != std::string_view::npos;
    has_texcoords_ = name.starts_with("ST");
  }

  std::size_t count(const std::string& what) {
    if (next_word_ == words_.size()) require_line();
    const std::string_view text = word();
    const std::optional<std::uint32_t> value = scan::parse<std::uint32_t>(text);
    if (!value) fail("got " + scan::quoted(text) + ", expected the number of " + what);
    return *value;
  }

  void vertex() {
    require_line();
    const float x = number(), y = number(), z = number();
    mesh.positions.emplace_back(x, y, z);
    for (int i = 0; has_normals_ && i < 3; ++i) number();
    for (int i = 0; has_texcoords_ && i < 2; ++i) {
      if (words_.size() <= next_word_) fail("too few numbers on the line");
      words_.pop_back();
    }
    const std::size_t vertices = mesh.positions.size();
    if (const auto found = color()) append_color(*found, vertices - 1, vertices, mesh.vertex_colors);
  }

  void face() {
    require_line();
    const std::size_t corners = count("corners");
    if (corners < 3) fail("a face with " + std::to_string(corners) + " corners: expected at least three");
    corners_.clear();
    for (std::size_t i = 0; i < corners; ++i) {
      const std::string_view text = word();
      const std::optional<std::uint32_t> index = scan::parse<std::uint32_t>(text);
      if (!index || *index >= vertices_) {
        fail("a face with the vertex " + scan::quoted(text) + ": expected a number below " +
             std::to_string(vertices_));
      }
      corners_.push_back(*index);
    }
    const std::size_t first = mesh.faces.size();
    append_fan(corners_, mesh.faces);
    if (const auto found = color()) append_color(*found, first, mesh.faces.size(), mesh.face_colors);
  }

  /// Reads the rest of the line: nothing, an entry of a colour map (ignored), or RGB or RGBA in bytes or
  /// floats.
  std::optional<glm::vec3> color() {
    const std::size_t left = words_.size() - next_word_;
    if (left == 1) number();
    if (left <= 1) return {};
    if (left != 3 && left != 4) fail(std::to_string(left) + " numbers for a colour: expected three or four");
    bool in_bytes = true;
    for (std::size_t i = next_word_; i < words_.size(); ++i) {
      in_bytes = in_bytes && scan::parse<std::uint8_t>(words_[i]).has_value();
    }
    const float one = in_bytes ? 255.0F : 1.0F;
    const float red = number(), green = number(), blue = number();
    if (left == 4) number();
    return glm::vec3(red, green, blue) / one;
  }

  const std::filesystem::path& file_;
  scan::Lines lines_;
  std::vector<std::string_view> words_;
  std::vector<std::uint32_t> corners_;
  std::size_t next_word_ = 0, vertices_ = 0, faces_ = 0;
  bool has_normals_ = false, has_texcoords_ = false;
};

}  // namespace

Mesh read_off(const std::filesystem::path& file, std::string_view text) {
  OffReader reader(file, text);
  reader.run();
  return std::move(reader.mesh);
}

}  // namespace dpr
