// The scan of STL.
//
// What OpenMesh 9 does with such a file:
// - a binary file of another length than its count of facets says is read as text, and has no faces;
// - in a text every line with "outer" in it, the solid's name included, starts a facet;
// - a facet with two equal corners is dropped.
//
// Those have no area and an STL facet has no attributes, so nothing is lost to the image or to the caller:
// the scan leaves them out of the count.
#include <algorithm>
#include <array>
#include <bit>

#include "dpr/error.hpp"
#include "mesh/mesh_scan.hpp"
#include "mesh/scan_text.hpp"

namespace dpr {
namespace {

constexpr std::size_t k_binary_header = 84;  // 80 bytes of anything, the number of facets in four
constexpr std::size_t k_binary_facet =
    50;  // normal and three corners in 12 bytes each, two bytes of attributes

using Facet = std::array<glm::vec3, 3>;

bool has_area(const Facet& f) { return f[0] != f[1] && f[1] != f[2] && f[2] != f[0]; }

template <typename Number>
Number little_endian(const std::string& text, std::size_t offset) {
  std::uint32_t bits = 0;
  for (std::size_t i = 4; i-- > 0;) bits = bits << 8U | static_cast<std::uint8_t>(text[offset + i]);
  return std::bit_cast<Number>(bits);
}

bool is_binary(const std::string& text) {
  if (text.size() >= k_binary_header) {
    const std::uint64_t facets = little_endian<std::uint32_t>(text, k_binary_header - 4);
    if (text.size() == k_binary_header + facets * k_binary_facet) return true;
  }
  const std::size_t begin = text.find_first_not_of(" \t\r\n");
  return begin == std::string::npos || text.compare(begin, 5, "solid") != 0;
}

MeshScan scan_binary(const std::filesystem::path& file, const std::string& text) {
  if (text.size() < k_binary_header) throw IoError(file, "the file is too short for an STL file");
  const std::uint64_t facets = little_endian<std::uint32_t>(text, k_binary_header - 4);
  if (text.size() < k_binary_header + facets * k_binary_facet) {
    throw IoError(file, "the file is truncated: expected " + std::to_string(facets) + " facets, got " +
                            std::to_string((text.size() - k_binary_header) / k_binary_facet));
  }
  MeshScan scan;
  scan.binary = true;
  for (std::size_t i = 0; i < facets; ++i) {
    Facet facet;
    std::size_t place = k_binary_header + i * k_binary_facet + 12;  // behind the normal
    for (glm::vec3& corner : facet) {
      for (int axis = 0; axis < 3; ++axis, place += 4) {
        const auto value = little_endian<float>(text, place);
        if (!std::isfinite(value)) {
          throw IoError(file, "facet " + std::to_string(i) + " has a coordinate that is not finite");
        }
        corner[axis] = value;
      }
    }
    if (has_area(facet)) ++scan.polygons;
  }
  scan.text = text;
  return scan;
}

class StlTextScanner {
 public:
  StlTextScanner(const std::filesystem::path& file, const std::string& text) : file_(file), lines_(text) {}

  void run() {
    bool ended = false;
    while (lines_.next()) {
      scan::split(lines_.line(), words_);
      if (words_.empty()) continue;
      ended = is("endsolid");
      if (is("outer")) begin_loop();
      if (is("vertex")) vertex();
      if (is("endloop")) end_loop();
    }
    if (!ended || corner_ != k_outside) fail("the file ends here: expected \"endsolid\"");
  }

  MeshScan scan;

 private:
  static constexpr std::size_t k_outside = 4;  // of any loop

  [[noreturn]] void fail(const std::string& reason) const { throw IoError(file_, reason, lines_.number()); }

  bool is(std::string_view keyword) const {
    return std::equal(words_[0].begin(), words_[0].end(), keyword.begin(), keyword.end(),
                      [](char a, char b) { return std::tolower(static_cast<unsigned char>(a)) == b; });
  }

  void begin_loop() {
    if (corner_ != k_outside) fail("a loop within a loop");
    corner_ = 0;
    scan.text += "outer loop\n";
  }

  void vertex() {
    if (corner_ >= 3) fail("a vertex too many: expected three in a loop");
    scan.text += "vertex";
    std::size_t word = 1;
    for (int axis = 0; axis < 3; ++axis, ++word) {
      if (word >= words_.size()) fail("too few numbers after \"vertex\"");
      const std::optional<float> value = scan::parse_coordinate(words_[word]);
      if (!value) fail("got " + scan::quoted(words_[word]) + ", expected a finite number");
      facet_[corner_][axis] = *value;
      scan.text += ' ';
      scan.text += words_[word];
    }
    scan.text += '\n';
    ++corner_;
  }

  void end_loop() {
    if (corner_ != 3) fail("a loop without three vertices");
    corner_ = k_outside;
    if (has_area(facet_)) ++scan.polygons;
  }

  const std::filesystem::path& file_;
  scan::Lines lines_;
  std::vector<std::string_view> words_;
  Facet facet_{};
  std::size_t corner_ = k_outside;
};

}  // namespace

MeshScan scan_stl(const std::filesystem::path& file, const std::string& text) {
  if (is_binary(text)) return scan_binary(file, text);
  StlTextScanner scanner(file, text);
  scanner.run();
  return std::move(scanner.scan);
}

}  // namespace dpr
