// Reads and checks the header of a PLY file, and writes the one that OpenMesh reads.
#include "mesh/ply_header.hpp"

#include <algorithm>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <utility>
#include <vector>

#include "dpr/error.hpp"
#include "mesh/scan_text.hpp"

namespace dpr {
namespace {

struct Property {
  std::string name, type, list_count_type;  // the last one is empty but for lists
  bool is_read = false;
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

std::size_t size_of(const std::string& type) {
  if (type.ends_with("char")) return 1;
  if (type.ends_with("short")) return 2;
  return type == "double" ? 8 : 4;
}

class PlyHeaderReader {
 public:
  PlyHeaderReader(const std::filesystem::path& file, std::string_view bytes)
      : file_(file), size_(bytes.size()), lines_(scan::without_byte_order_mark(bytes)) {}

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
    header.binary = format_ != "ascii";
    prepare_vertices(vertex);
    prepare_faces(face);
    header.vertices = vertex.count;
    header.polygons = face.count;
    header.ends_with_faces = &face == &elements_.back();
    header.lines = lines_.number();
    header.bytes = size_ - lines_.rest().size();
    write_header(read);
    check_size(read);
    if (!header.binary) check_lines(face);
  }

  PlyHeader header;

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
      if (words_.size() > 2 && words_[0] == "comment" && words_[1] == "TextureFile")
        header.textures.emplace_back(scan::behind(lines_.line(), words_[1]));
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
    header.vertex_colors = prepare_colors(vertex);
    // By MeshLab, Blender, Houdini and others.
    constexpr std::array<std::array<std::string_view, 2>, 4> k_pairs{
        {{"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}, {"texture_s", "texture_t"}}};
    for (const auto& names : k_pairs)
      header.has_texcoords = header.has_texcoords || prepare_floats(vertex, names, k_custom_texcoords);
    header.has_normals =
        prepare_floats(vertex, std::array<std::string_view, 3>{"nx", "ny", "nz"}, k_custom_normals);
    rename(vertex, {"x", "y", "z"});
  }

  void prepare_faces(Element& face) {
    const Property* corners = face.properties.empty() ? nullptr : &face.properties[0];
    if (!corners || (corners->name != "vertex_indices" && corners->name != "vertex_index") ||
        corners->list_count_type.empty() || is_floating(corners->type)) {
      fail("expected the list vertex_indices as the first property of the element face");
    }
    header.face_colors = prepare_colors(face);
    // By MeshLab.
    Property* const texcoords = find(face, "texcoord");
    header.has_corner_texcoords =
        texcoords && !texcoords->list_count_type.empty() && is_floating(texcoords->type);
    if (header.has_corner_texcoords) read_as(*texcoords, k_custom_corner_texcoords);
    Property* const texture = find(face, "texnumber");
    header.has_texture_numbers = texture && texture->list_count_type.empty() && !is_floating(texture->type);
    if (header.has_texture_numbers) read_as(*texture, k_custom_texture);
    rename(face, {"vertex_indices", "vertex_index"});
    header.has_custom_properties = has_lists(face) || header.vertex_colors.custom ||
                                   header.face_colors.custom || header.has_texcoords || header.has_normals ||
                                   header.has_texture_numbers;
  }

  // Lists beside the corners.
  static bool has_lists(const Element& face) {
    const auto is_list = [](const Property& property) { return !property.list_count_type.empty(); };
    return std::any_of(face.properties.begin() + 1, face.properties.end(), is_list);
  }

  /// Throws where the file is too short for the numbers that its header promises, however short the lists.
  void check_size(const std::vector<const Element*>& read) const {
    std::uint64_t least = 0;
    for (const Element* element : read) {
      std::uint64_t bytes = 0;
      for (const Property& property : element->properties) {
        const bool is_list = !property.list_count_type.empty();
        const std::string& type = is_list ? property.list_count_type : property.type;
        bytes += header.binary ? size_of(type) : 2;  // in a text a digit and what parts it from the next
      }
      least += element->count * bytes;
    }
    // The last number of a text need not be parted from anything.
    if (lines_.rest().size() + (header.binary ? 0 : 1) >= least) return;
    throw IoError(file_,
                  "the file is truncated: its header promises " + std::to_string(least) + " bytes or more");
  }

  // Every line of a text must hold the numbers of one element, no fewer and no more: OpenMesh, which reads number after
  // number, would take those of the next line for it, or the rest for the next element's.
  void check_lines(const Element& face) {
    for (const Element* element = elements_.data(); element != &face; ++element) {
      for (std::uint64_t i = 0; i < element->count && !element->properties.empty() && next_numbers(); ++i) {
        if (words_.size() != element->properties.size())
          fail("expected " + std::to_string(element->properties.size()) + " numbers, of one " +
               element->name);
      }
    }
    for (std::uint64_t i = 0; i < face.count && next_numbers(); ++i) check_line_of_face(face);
  }

  void check_line_of_face(const Element& face) {
    std::size_t word = 0;
    for (const Property& property : face.properties) {
      if (word >= words_.size()) fail("too few numbers for a face");
      const auto length = scan::parse<std::uint32_t>(words_[word++]);
      if (property.list_count_type.empty()) continue;
      if (!length || *length > words_.size() - word) fail("too few numbers for a face");
      word += *length;
    }
    if (word < words_.size()) fail("too many numbers for a face");
  }

  // The words of the next line that has some; false at the end.
  bool next_numbers() {
    while (lines_.next()) {
      scan::split(lines_.line(), words_);
      if (!words_.empty()) return true;
    }
    return false;
  }

  // Only all three together are colours.
  ColorForm prepare_colors(Element& element) const {
    constexpr std::array<const char*, 3> k_names{"red", "green", "blue"};
    std::array<Property*, 3> channels{};
    for (std::size_t i = 0; i < k_names.size(); ++i) {
      channels[i] = find(element, k_names[i]);
      if (!channels[i]) channels[i] = find(element, "diffuse_" + std::string(k_names[i]));
      if (!channels[i] || !channels[i]->list_count_type.empty()) return {};
    }
    for (std::size_t i = 0; i < channels.size(); ++i) {
      const std::string& type = channels[i]->type;
      if (type != channels[0]->type || (type != "uchar" && !is_floating(type))) {
        fail("the colours of the element " + element.name + " in " + type +
             ": expected uchar, float or double");
      }
      channels[i]->name = type == "uchar" && header.binary ? k_names[i] : k_custom_colors[i];
      channels[i]->is_read = true;
    }
    const bool in_bytes = channels[0]->type == "uchar", native = in_bytes && header.binary;
    return {!native, native, in_bytes ? 255.0 : 1.0};
  }

  // True if the element has all of these as floats; the function then renames them so that they pass.
  template <std::size_t count>
  static bool prepare_floats(Element& element, const std::array<std::string_view, count>& names,
                             const std::array<const char*, count>& custom) {
    std::array<Property*, count> found{};
    for (std::size_t i = 0; i < count; ++i) {
      found[i] = find(element, std::string(names[i]));
      if (!found[i] || !found[i]->list_count_type.empty() || !is_floating(found[i]->type)) return false;
    }
    for (std::size_t i = 0; i < count; ++i) read_as(*found[i], custom[i]);
    return true;
  }

  static void read_as(Property& property, const char* name) {
    property.name = name;
    property.is_read = true;
  }

  static Property* find(Element& element, const std::string& name) {
    for (Property& property : element.properties) {
      if (property.name == name) return &property;
    }
    return nullptr;
  }

  static void rename(Element& element, std::initializer_list<std::string_view> kept) {
    for (Property& property : element.properties) {
      const auto is_it = [&](std::string_view name) { return name == property.name; };
      if (!property.is_read && std::none_of(kept.begin(), kept.end(), is_it))
        property.name = "dpr_other_" + property.name;
    }
  }

  // The type under which OpenMesh reads a property as it stands: in a text the types only say how to parse.
  std::string written_type(const Property& property) const {
    if (header.binary) return property.type;
    if (property.name.starts_with("dpr_")) return "double";
    return is_floating(property.type) || property.type == "uchar" ? property.type : "int";
  }

  std::string written_count_type(const Property& property) const {
    const std::string& type = property.list_count_type;
    if (!header.binary || type == "uint" || type == "int") return "int";
    return type == "uchar" || type == "char" ? "uchar" : "uint16";
  }

  void write_header(const std::vector<const Element*>& elements) {
    header.text = "ply\nformat " + format_ + " 1.0\n";
    for (const Element* element : elements) {
      header.text += "element " + element->name + " " + std::to_string(element->count) + "\n";
      for (const Property& property : element->properties) {
        header.text += "property ";
        if (!property.list_count_type.empty()) header.text += "list " + written_count_type(property) + " ";
        header.text += written_type(property) + " " + property.name + "\n";
      }
    }
    header.text += "end_header\n";
  }

  const std::filesystem::path& file_;
  std::size_t size_;
  scan::Lines lines_;
  std::vector<std::string_view> words_;
  std::string format_;
  std::vector<Element> elements_;
};

}  // namespace

PlyHeader read_ply_header(const std::filesystem::path& file, std::string_view bytes) {
  PlyHeaderReader reader(file, bytes);
  reader.run();
  return std::move(reader.header);
}

}  // namespace dpr
