// The scan of PLY: the header is read, checked and written anew; the body is OpenMesh's.
//
// What OpenMesh 9 does with such a file:
// - colours in floats are cut to eight bits, downwards; those of other types wrap around;
// - a list other than the corners is skipped as if it were one number, unless custom properties are asked
// for;
//   then it is allocated at the length it claims, and in a text a property of type uchar is one character;
// - lists may be counted by uint8, uint16, uchar and int alone;
// - a normal that is not in floats is not skipped at all;
// - a header that never ends is read for ever.
//
// So every property but the coordinates, the corners and colours in bytes gets a name that means nothing to
// OpenMesh, and types that it skips correctly.
#include <algorithm>
#include <array>

#include "dpr/error.hpp"
#include "mesh/mesh_scan.hpp"
#include "mesh/scan_text.hpp"

namespace dpr {
namespace {

struct Property {
  std::string name, type, list_count_type;  // the last one is empty but for lists
};

struct Element {
  std::string name;
  std::uint32_t count = 0;
  std::vector<Property> properties;
};

// Types by their short names; both names mean the same, and OpenMesh does not know all of both everywhere.
std::string short_type(std::string_view type) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 8> k_types{{{"int8", "char"},
                                                                                  {"uint8", "uchar"},
                                                                                  {"int16", "short"},
                                                                                  {"uint16", "ushort"},
                                                                                  {"int32", "int"},
                                                                                  {"uint32", "uint"},
                                                                                  {"float32", "float"},
                                                                                  {"float64", "double"}}};
  for (const auto& [long_name, short_name] : k_types) {
    if (type == long_name || type == short_name) return std::string(short_name);
  }
  return {};
}

bool is_floating(const std::string& type) { return type == "float" || type == "double"; }

class PlyScanner {
 public:
  PlyScanner(const std::filesystem::path& file, const std::string& text) : file_(file), lines_(text) {}

  void run() {
    read_header();
    Element& vertex = find("vertex");
    Element& face = find("face");
    check_order();
    std::vector<const Element*> read;
    for (const Element& element : elements_) {
      if (!element.properties.empty()) read.push_back(&element);
      if (&element == &face) break;  // what follows the faces is not read
    }
    prepare_vertices(vertex);
    prepare_faces(face);
    scan.vertices = vertex.count;
    scan.polygons = face.count;
    scan.binary = format_ != "ascii";
    scan.ends_with_polygons = &face == &elements_.back();
    write_header(read);
    scan.header_lines = lines_.number();
    const std::string_view body = lines_.rest();
    if (!scan.binary && has_lists(face)) check_lists(face);
    scan.header_bytes = scan.text.size();
    scan.text += body;
  }

  MeshScan scan;

 private:
  [[noreturn]] void fail(const std::string& reason) const { throw IoError(file_, reason, lines_.number()); }

  void next_line() {
    if (!lines_.next()) fail("the header has no end: expected \"end_header\"");
    scan::split(lines_.line(), words_);
  }

  void read_header() {
    if (lines_.next()) scan::split(lines_.line(), words_);
    if (words_.size() != 1 || (words_[0] != "ply" && words_[0] != "PLY")) fail("not a PLY file");
    for (next_line(); words_.empty() || words_[0] != "end_header"; next_line()) {
      if (words_.empty() || words_[0] == "comment" || words_[0] == "obj_info") continue;
      if (words_[0] == "format") {
        format();
      } else if (words_[0] == "element") {
        element();
      } else if (words_[0] == "property") {
        property();
      } else {
        fail("got " + scan::quoted(words_[0]) + ", expected format, element, property or end_header");
      }
    }
    if (format_.empty()) fail("the header names no format");
  }

  void format() {
    constexpr std::array<std::string_view, 3> k_formats{"ascii", "binary_little_endian", "binary_big_endian"};
    if (words_.size() < 2 || std::find(k_formats.begin(), k_formats.end(), words_[1]) == k_formats.end()) {
      fail("expected the format ascii, binary_little_endian or binary_big_endian");
    }
    format_ = words_[1];
  }

  void element() {
    const std::optional<std::uint32_t> count =
        words_.size() == 3 ? scan::parse<std::uint32_t>(words_[2]) : std::nullopt;
    if (!count) fail("expected \"element NAME COUNT\"");
    elements_.push_back({std::string(words_[1]), *count, {}});
  }

  void property() {
    const bool is_list = words_.size() == 5 && words_[1] == "list";
    if (elements_.empty() || (!is_list && words_.size() != 3)) {
      fail("expected \"property TYPE NAME\" or \"property list TYPE TYPE NAME\" after an element");
    }
    Property property{std::string(words_.back()), short_type(words_[words_.size() - 2]), {}};
    if (is_list) property.list_count_type = short_type(words_[2]);
    if (property.type.empty() || (is_list && property.list_count_type.empty())) {
      fail("a property of unknown type: expected char, uchar, short, ushort, int, uint, float or double");
    }
    if (is_floating(property.list_count_type)) fail("a list counted in floats");
    const bool is_corners = property.name == "vertex_indices" || property.name == "vertex_index";
    if (format_ != "ascii" && property.list_count_type.ends_with("int") && !is_corners) {
      fail("the list " + property.name + " counted in int: expected uchar or ushort");
    }
    for (const Property& other : elements_.back().properties) {
      if (other.name == property.name) fail("the property " + property.name + " twice");
    }
    elements_.back().properties.push_back(std::move(property));
  }

  Element& find(const std::string& name) {
    const auto is_named = [&](const Element& element) { return element.name == name; };
    const auto found = std::find_if(elements_.begin(), elements_.end(), is_named);
    if (found == elements_.end()) fail("the header has no element " + name);
    if (std::find_if(std::next(found), elements_.end(), is_named) != elements_.end()) {
      fail("the header has the element " + name + " twice");
    }
    return *found;
  }

  void check_order() const {
    bool vertices_seen = false;
    for (const Element& element : elements_) {
      vertices_seen = vertices_seen || element.name == "vertex";
      if (element.name == "face") {
        if (!vertices_seen) fail("the element face before the element vertex");
        return;
      }
      for (const Property& property : element.properties) {
        if (property.list_count_type.empty()) continue;
        fail("the list " + property.name + " of the element " + element.name +
             ": expected lists of faces only");
      }
    }
  }

  void prepare_vertices(Element& vertex) {
    for (const char* axis : {"x", "y", "z"}) {
      const Property* property = find(vertex, axis);
      if (!property || !is_floating(property->type)) {
        fail("expected the vertex properties x, y and z, each float or double");
      }
    }
    scan.has_vertex_colors = prepare_colors(vertex);
    rename(vertex, {"x", "y", "z"});
  }

  void prepare_faces(Element& face) {
    const Property* corners = face.properties.empty() ? nullptr : &face.properties[0];
    if (!corners || (corners->name != "vertex_indices" && corners->name != "vertex_index") ||
        corners->list_count_type.empty() || is_floating(corners->type)) {
      fail("expected the list vertex_indices as the first property of the element face");
    }
    scan.has_face_colors = prepare_colors(face);
    rename(face, {"vertex_indices", "vertex_index"});
    if (has_lists(face)) scan.asks_custom_properties = true;
  }

  // Lists beside the corners.
  static bool has_lists(const Element& face) {
    const auto is_list = [](const Property& property) { return !property.list_count_type.empty(); };
    return std::any_of(face.properties.begin() + 1, face.properties.end(), is_list);
  }

  // No list of a face in a text may claim more than its line holds.
  void check_lists(const Element& face) {
    std::uint64_t before = 0;
    for (const Element* element = elements_.data(); element != &face; ++element) {
      before += element->properties.empty() ? 0 : element->count;
    }
    for (std::uint64_t i = 0; i < before + face.count && lines_.next();) {
      scan::split(lines_.line(), words_);
      if (words_.empty()) continue;
      if (i++ < before) continue;
      std::size_t word = 0;
      for (const Property& property : face.properties) {
        if (word >= words_.size()) fail("too few numbers for a face");
        const auto length = scan::parse<std::uint32_t>(words_[word++]);
        if (property.list_count_type.empty()) continue;
        if (!length || *length > words_.size() - word) fail("too few numbers for a face");
        word += *length;
      }
    }
  }

  // Colours in bytes keep their names, colours in floats get ours. Only all three together are colours.
  bool prepare_colors(Element& element) {
    constexpr std::array<const char*, 3> k_names{"red", "green", "blue"};
    std::array<Property*, 3> channels{};
    for (std::size_t i = 0; i < k_names.size(); ++i) {
      channels[i] = find(element, k_names[i]);
      if (!channels[i]) channels[i] = find(element, "diffuse_" + std::string(k_names[i]));
      if (!channels[i] || !channels[i]->list_count_type.empty()) return false;
    }
    for (std::size_t i = 0; i < channels.size(); ++i) {
      const std::string& type = channels[i]->type;
      if (type != channels[0]->type || (type != "uchar" && !is_floating(type))) {
        fail("the colours of the element " + element.name + " in " + type +
             ": expected uchar, float or double");
      }
      channels[i]->name = is_floating(type) ? k_ply_float_colors[i] : k_names[i];
    }
    if (is_floating(channels[0]->type)) scan.asks_custom_properties = true;
    return true;
  }

  static Property* find(Element& element, const std::string& name) {
    for (Property& property : element.properties) {
      if (property.name == name) return &property;
    }
    return nullptr;
  }

  void rename(Element& element, std::initializer_list<std::string_view> kept) {
    for (Property& property : element.properties) {
      const auto is_it = [&](std::string_view name) { return name == property.name; };
      if (std::any_of(kept.begin(), kept.end(), is_it)) continue;
      if (std::any_of(std::begin(k_ply_float_colors), std::end(k_ply_float_colors), is_it)) continue;
      const bool is_color = property.name == "red" || property.name == "green" || property.name == "blue";
      const bool has_colors = element.name == "vertex" ? scan.has_vertex_colors : scan.has_face_colors;
      if (!(is_color && has_colors)) property.name = "dpr_other_" + property.name;
    }
  }

  // The type under which OpenMesh reads a property as it stands: in a text the types only say how to parse.
  std::string written_type(const Property& property) const {
    if (scan.binary) return property.type;
    if (property.name.starts_with("dpr_")) return "double";
    return is_floating(property.type) || property.type == "uchar" ? property.type : "int";
  }

  std::string written_count_type(const Property& property) const {
    const std::string& type = property.list_count_type;
    if (!scan.binary || type == "uint" || type == "int") return "int";
    return type == "uchar" || type == "char" ? "uchar" : "uint16";
  }

  void write_header(const std::vector<const Element*>& elements) {
    scan.text = "ply\nformat " + format_ + " 1.0\n";
    for (const Element* element : elements) {
      scan.text += "element " + element->name + " " + std::to_string(element->count) + "\n";
      for (const Property& property : element->properties) {
        scan.text += "property ";
        if (!property.list_count_type.empty()) scan.text += "list " + written_count_type(property) + " ";
        scan.text += written_type(property) + " " + property.name + "\n";
      }
    }
    scan.text += "end_header\n";
  }

  const std::filesystem::path& file_;
  scan::Lines lines_;
  std::vector<std::string_view> words_;
  std::string format_;
  std::vector<Element> elements_;
};

}  // namespace

MeshScan scan_ply(const std::filesystem::path& file, const std::string& text) {
  PlyScanner scanner(file, text);
  scanner.run();
  return std::move(scanner.scan);
}

}  // namespace dpr
