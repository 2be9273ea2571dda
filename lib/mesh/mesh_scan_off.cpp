// The scan of OFF.
//
// What OpenMesh 9 does with such a file:
// - face colours are read only under the header COFF; under OFF, where everybody writes them, the first
// number
//   of a colour is taken for the next face's number of corners;
// - after a comment, or with the counts on the header's line, there are no vertices;
// - two spaces between colours count as one colour more;
// - it never looks for the end of the file while it reads faces: a truncated file repeats its last face until
//   there are as many as it promises.
//
// So the scan takes the file apart, keeps the colours, and passes on the bare geometry.
#include "dpr/error.hpp"
#include "mesh/mesh_scan.hpp"
#include "mesh/scan_text.hpp"

namespace dpr {
namespace {

class OffScanner {
 public:
  OffScanner(const std::filesystem::path& file, const std::string& text) : file_(file), lines_(text) {}

  void run() {
    header();
    vertices_ = count("vertices");
    scan.polygons = count("faces");
    scan.vertices = vertices_;
    scan.text = "OFF\n" + std::to_string(vertices_) + " " + std::to_string(scan.polygons) + " 0\n";
    for (std::size_t i = 0; i < vertices_; ++i) vertex();
    for (std::size_t i = 0; i < scan.polygons; ++i) face();
    if (!has_vertex_colors_) scan.vertex_colors.clear();
    if (!has_face_colors_) scan.face_colors.clear();
  }

  MeshScan scan;

 private:
  [[noreturn]] void fail(const std::string& reason) const { throw IoError(file_, reason, lines_.number()); }

  // The words of the next line that has any.
  void next_line() {
    while (lines_.next()) {
      scan::split(lines_.line().substr(0, lines_.line().find('#')), words_);
      next_word_ = 0;
      if (!words_.empty()) return;
    }
    fail("the file ends here: expected " + std::to_string(vertices_) + " vertices and " +
         std::to_string(scan.polygons) + " faces");
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
    next_line();
    const std::string_view name = word();
    if (name != "OFF" && name != "COFF")
      fail("got the header " + scan::quoted(name) + ", expected OFF or COFF");
    if (next_word_ < words_.size() && words_[next_word_] == "BINARY")
      fail("a binary OFF file: expected one of text");
  }

  std::size_t count(const std::string& what) {
    if (next_word_ == words_.size()) next_line();
    const std::string_view text = word();
    const std::optional<std::uint32_t> value = scan::parse<std::uint32_t>(text);
    if (!value) fail("got " + scan::quoted(text) + ", expected the number of " + what);
    return *value;
  }

  void vertex() {
    next_line();
    for (int i = 0; i < 3; ++i) {
      number();
      append(words_[next_word_ - 1], i < 2);
    }
    scan.vertex_colors.push_back(color(has_vertex_colors_));
  }

  void face() {
    next_line();
    const std::size_t corners = count("corners");
    if (corners < 3) fail("a face with " + std::to_string(corners) + " corners: expected at least three");
    append(words_[0], true);
    for (std::size_t i = 0; i < corners; ++i) {
      const std::string_view text = word();
      const std::optional<std::uint32_t> index = scan::parse<std::uint32_t>(text);
      if (!index || *index >= vertices_) {
        fail("a face with the vertex " + scan::quoted(text) + ": expected a number below " +
             std::to_string(vertices_));
      }
      append(text, i + 1 < corners);
    }
    scan.face_colors.push_back(color(has_face_colors_));
  }

  // What is left of the line: nothing, an entry of a colour map (ignored), or RGB or RGBA in bytes or floats.
  glm::vec3 color(bool& found) {
    const std::size_t left = words_.size() - next_word_;
    if (left <= 1) return glm::vec3(1);
    if (left != 3 && left != 4) fail(std::to_string(left) + " numbers for a colour: expected three or four");
    bool in_bytes = true;
    for (std::size_t i = next_word_; i < words_.size(); ++i) {
      in_bytes = in_bytes && scan::parse<std::uint8_t>(words_[i]).has_value();
    }
    const float one = in_bytes ? 255.0F : 1.0F;
    found = true;
    const float red = number(), green = number(), blue = number();
    return glm::vec3(red, green, blue) / one;
  }

  void append(std::string_view text, bool more) {
    scan.text += text;
    scan.text += more ? ' ' : '\n';
  }

  const std::filesystem::path& file_;
  scan::Lines lines_;
  std::vector<std::string_view> words_;
  std::size_t next_word_ = 0, vertices_ = 0;
  bool has_vertex_colors_ = false, has_face_colors_ = false;
};

}  // namespace

MeshScan scan_off(const std::filesystem::path& file, const std::string& text) {
  OffScanner scanner(file, text);
  scanner.run();
  return std::move(scanner.scan);
}

}  // namespace dpr
