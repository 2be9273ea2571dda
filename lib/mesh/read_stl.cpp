// The reader of STL, text and binary. An STL has no shared vertices: corners at equal positions become one.
//
// A facet with two equal corners has no area and no attributes, so nothing is lost where it is left out.
#include <algorithm>
#include <array>

#include "dpr/error.hpp"
#include "mesh/little_endian.hpp"
#include "mesh/mesh_reader.hpp"
#include "mesh/scan_text.hpp"
#include "mesh/weld.hpp"

namespace dpr {
namespace {

constexpr std::size_t k_binary_header = 84;  // 80 bytes of anything, the number of facets in four
constexpr std::size_t k_binary_facet =
    50;  // normal and three corners in 12 bytes each, two bytes of attributes

using Facet = std::array<glm::vec3, 3>;

bool has_area(const Facet& f) { return f[0] != f[1] && f[1] != f[2] && f[2] != f[0]; }

/// Equal corners become one vertex; the vertices are in the order in which the corners first name them.
Mesh mesh_of(const std::vector<Facet>& facets) {
  Mesh mesh;
  mesh.positions.reserve(3 * facets.size());
  for (const Facet& facet : facets) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), facet.begin(), facet.end());
    mesh.faces.emplace_back(first, first + 1, first + 2);
  }
  weld(mesh);
  return mesh;
}

/// Bytes that the number of facets promises.
std::uint64_t binary_size(std::string_view bytes) {
  return k_binary_header +
         std::uint64_t{little_endian<std::uint32_t>(bytes, k_binary_header - 4)} * k_binary_facet;
}

/// Many a binary file begins with "solid" too.
bool is_binary(std::string_view bytes) {
  if (bytes.size() >= k_binary_header && bytes.size() == binary_size(bytes)) return true;
  const std::string_view text = scan::without_byte_order_mark(bytes);
  return !text.substr(std::min(text.find_first_not_of(" \t\r\n"), text.size())).starts_with("solid");
}

/// Notes the attributes of a binary file whose length agrees with its header.
void note_attributes(const std::filesystem::path& file, std::string_view bytes, Notes& notes) {
  std::size_t count = 0;
  for (std::size_t end = k_binary_header + k_binary_facet; end <= bytes.size(); end += k_binary_facet)
    count += bytes[end - 2] != 0 || bytes[end - 1] != 0 ? 1U : 0U;
  if (count == 0) return;
  notes.push_back(file.string() + ": the attributes of " + std::to_string(count) +
                  " facets, which may be colours, are not read");
}

std::vector<Facet> binary_facets(const std::filesystem::path& file, std::string_view bytes) {
  if (bytes.size() < k_binary_header) throw IoError(file, "the file is too short for an STL file");
  const std::uint64_t size = binary_size(bytes);
  const std::uint64_t count = (size - k_binary_header) / k_binary_facet;
  if (bytes.size() < size) {
    throw IoError(file, "the file is truncated: expected " + std::to_string(count) + " facets, got " +
                            std::to_string((bytes.size() - k_binary_header) / k_binary_facet));
  }
  if (bytes.size() > size) {
    throw IoError(file, "the file goes on after the last of the " + std::to_string(count) +
                            " facets that its header promises");
  }
  std::vector<Facet> facets;
  facets.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    Facet facet;
    std::size_t place = k_binary_header + i * k_binary_facet + 12;  // behind the normal
    for (glm::vec3& corner : facet) {
      for (int axis = 0; axis < 3; ++axis, place += 4) {
        corner[axis] = little_endian<float>(bytes, place);
        if (std::isfinite(corner[axis])) continue;
        throw IoError(file, "facet " + std::to_string(i) + " has a coordinate that is not finite");
      }
    }
    if (has_area(facet)) facets.push_back(facet);
  }
  return facets;
}

class StlTextReader {
 public:
  StlTextReader(const std::filesystem::path& file, std::string_view text)
      : file_(file), lines_(scan::without_byte_order_mark(text)) {}

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

  std::vector<Facet> facets;

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
  }

  void vertex() {
    if (corner_ >= 3) fail("a vertex too many: expected three in a loop");
    if (words_.size() != 4) fail("expected three numbers after \"vertex\"");
    for (int axis = 0; axis < 3; ++axis) {
      const std::string_view word = words_[static_cast<std::size_t>(axis) + 1];
      const std::optional<float> value = scan::parse_coordinate(word);
      if (!value) fail("got " + scan::quoted(word) + ", expected a finite number");
      facet_[corner_][axis] = *value;
    }
    ++corner_;
  }

  void end_loop() {
    if (corner_ != 3) fail("a loop without three vertices");
    corner_ = k_outside;
    if (has_area(facet_)) facets.push_back(facet_);
  }

  const std::filesystem::path& file_;
  scan::Lines lines_;
  std::vector<std::string_view> words_;
  Facet facet_{};
  std::size_t corner_ = k_outside;
};

}  // namespace

Mesh read_stl(const std::filesystem::path& file, std::string_view bytes, Notes& notes) {
  if (is_binary(bytes)) {
    Mesh mesh = mesh_of(binary_facets(file, bytes));
    note_attributes(file, bytes, notes);
    return mesh;
  }
  StlTextReader reader(file, bytes);
  reader.run();
  return mesh_of(reader.facets);
}

}  // namespace dpr
